#include "io/report/tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "io/report/page.h"
#include "io/results/residual.h"

namespace birefit::page {
namespace {

std::string estimate_html(const ParameterEstimate& p) {
  if (!p.limit.empty())
    return fmt::format("{} {}{}", p.limit == "upper" ? "&lt;" : "&gt;", plain(p.limit_value), unit_suffix(p.unit));
  if (!std::isfinite(p.stderr_)) return plain(p.value) + unit_suffix(p.unit) + " <small>\u00b1 not known</small>";
  return fmt::format("{} <small>\u00b1 {}</small>{}", value_html(p.value, p.stderr_),
                     html_number(format_error(p.stderr_)),
                     p.unit.empty() ? "" : "<small>" + unit_suffix(p.unit) + "</small>");
}

std::string interval_html(double low, double high, double error) {
  if (!std::isfinite(low) && !std::isfinite(high)) return "\u2013";
  return value_html(low, error) + " \u2026 " + value_html(high, error);
}

std::string bound_html(double bound) {
  return std::isfinite(bound) ? plain(bound) : bound < 0 ? "\u2212\u221e" : "\u221e";
}

std::string correlation_html(double c) {
  const double left = 1 - std::abs(c);
  // -0.999998 must not be rounded to -1.
  const int digits = left > 1e-12 && left < 0.005 ? std::min(7, 1 - static_cast<int>(std::floor(std::log10(left)))) : 2;
  return html_number(fmt::format("{:.{}f}", c, digits));
}

}  // namespace

std::string key_numbers(const FitResult& result) {
  constexpr std::size_t kShown = 5;
  std::string out = "<dl class=\"key\">\n";
  std::size_t shown = 0;
  // What was asked for first; centres and gains are means to that end.
  for (const bool nuisance : {false, true})
    for (const ParameterEstimate& p : result.parameters) {
      const bool is_nuisance = p.linear || p.name.find("center_px") != std::string::npos || p.unit == "px";
      if (is_nuisance != nuisance || shown >= (nuisance ? 1 : kShown)) continue;
      ++shown;
      out += "<div><dt>" + escape_html(short_name(p.name)) + "</dt><dd>" + estimate_html(p) + "</dd></div>\n";
    }
  for (const DerivedEstimate& d : result.derived)
    if (!d.tied && d.stderr_ > 0 && shown++ < 2 * kShown)
      out += "<div><dt>" + escape_html(d.name) + "</dt><dd>" +
             fmt::format("{} <small>\u00b1 {}</small>{}", value_html(d.value, d.stderr_),
                         html_number(format_error(d.stderr_)),
                         d.unit.empty() ? "" : "<small>" + unit_suffix(d.unit) + "</small>") +
             "</dd></div>\n";
  out += "<div><dt>reduced chi-square</dt><dd>" + plain(result.reduced_chi_square) +
         fmt::format(" <small>{} d.o.f.</small></dd></div>\n", result.degrees_of_freedom);
  if (const double fraction = residual_fraction(result); std::isfinite(fraction))
    out += "<div><dt>residual rms</dt><dd>" + format_percent(fraction) + " <small>of signal range</small></dd></div>\n";
  return out + "</dl>\n";
}

std::string parameter_table(const FitResult& result) {
  std::string out =
      "<div class=\"scroll\"><table class=\"full\">\n<tr><th>parameter</th><th>value</th><th>std. "
      "error</th><th>relative</th>"
      "<th>95 % interval</th><th>start</th><th>bounds</th><th>prior</th><th class=\"left\">unit</th></tr>\n";
  for (const ParameterEstimate& p : result.parameters) {
    const double error = p.stderr_;
    const std::string brief = short_name(p.name);
    std::string flags;
    if (!p.limit.empty())
      flags =
          fmt::format("<br><span class=\"flag\">95 % {} limit {}</span>", escape_html(p.limit), plain(p.limit_value));
    else if (p.at_bound)
      flags = "<br><span class=\"flag\">at its bound</span>";
    else if (p.profiled)
      flags = "<br><small>interval by profile likelihood</small>";
    out += "<tr><td class=\"name\">" + escape_html(brief) +
           (brief != p.name ? "<small>" + escape_html(p.name) + "</small>" : "") + "</td>";
    out += "<td class=\"value\">" + value_html(p.value, error) + flags + "</td>";
    out += "<td>" + html_number(format_error(error)) + "</td>";
    out += "<td>" + (p.value != 0 ? html_number(format_percent(error / p.value)) : "\u2013") + "</td>";
    out += "<td>" + interval_html(p.interval95_low, p.interval95_high, error) + "</td>";
    out += "<td>" + (p.linear ? "\u2013" : plain(p.start)) + "</td>";
    out += "<td>" +
           (std::isfinite(p.lower) || std::isfinite(p.upper) ? bound_html(p.lower) + " \u2026 " + bound_html(p.upper)
                                                             : "none") +
           "</td>";
    out += "<td>" +
           (p.prior_sd
                ? plain(p.prior_value.value_or(p.start)) + " \u00b1 " + html_number(fmt::format("{:.2g}", *p.prior_sd))
                : "\u2013") +
           "</td>";
    out += "<td class=\"left\">" + pretty_unit(p.unit) + "</td></tr>\n";
  }
  return out + "</table></div>\n";
}

std::string derived_table(const FitResult& result) {
  std::string rows;
  for (const DerivedEstimate& d : result.derived) {
    const std::string brief = short_name(d.name);
    rows += "<tr><td class=\"name\">" + escape_html(brief) +
            (brief != d.name ? "<small>" + escape_html(d.name) + "</small>" : "") + "</td>";
    rows += "<td class=\"value\">" + (d.stderr_ > 0 ? value_html(d.value, d.stderr_) : plain(d.value)) + "</td>";
    rows += "<td>" +
            (d.stderr_ > 0    ? html_number(format_error(d.stderr_))
             : d.stderr_ == 0 ? "exact"
                              : "not known") +
            "</td>";
    rows += "<td>" + (d.stderr_ > 0 ? interval_html(d.interval95_low, d.interval95_high, d.stderr_) : "\u2013") +
            "</td><td class=\"left\">" + pretty_unit(d.unit) + "</td><td class=\"left\"><code>" +
            escape_html(printable(d.expression)) + "</code></td></tr>\n";
  }
  if (rows.empty()) return {};
  return "<h3>What follows from them</h3>\n<div class=\"scroll\"><table class=\"full\">\n<tr><th>quantity</th>"
         "<th>value</th><th>std. error</th><th>95 % interval</th><th class=\"left\">unit</th><th class=\"left\">"
         "by</th></tr>\n" +
         rows + "</table></div>\n";
}

std::string correlation_table(const FitResult& result) {
  const Eigen::Index count = std::min<Eigen::Index>(result.correlation.rows(), std::ssize(result.names));
  if (count < 2 || result.correlation.cols() < count) return {};
  std::string out = "<h2>Correlations</h2>\n<div class=\"scroll\"><table class=\"matrix\">\n<tr><th></th>";
  for (Eigen::Index j = 0; j + 1 < count; ++j)
    out += fmt::format("<th title=\"{}\">{}</th>", escape_html(result.names[j]), j + 1);
  out += "</tr>\n";
  for (Eigen::Index i = 0; i < count; ++i) {
    out += fmt::format("<tr><td title=\"{}\">{}&ensp;{}</td>", escape_html(result.names[i]), i + 1,
                       escape_html(short_name(result.names[i])));
    for (Eigen::Index j = 0; j < i; ++j) {
      const double c = result.correlation(i, j);
      if (!std::isfinite(c)) {
        out += "<td>\u2013</td>";
        continue;
      }
      // Blue against red like the residual, by mixing towards white; strong cells get white figures.
      const double strength = std::pow(std::min(std::abs(c), 1.0), 1.3);
      const std::array<int, 3> end = c < 0 ? std::array{33, 102, 172} : std::array{178, 24, 43};
      std::array<int, 3> rgb;
      for (int k = 0; k < 3; ++k) rgb[k] = static_cast<int>(std::lround(255 + strength * (end[k] - 255)));
      out += fmt::format("<td style=\"background:rgb({},{},{});color:{}\">{}</td>", rgb[0], rgb[1], rgb[2],
                         strength > 0.6 ? "#fff" : "#1d2127", correlation_html(c));
    }
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

std::string branch_table(const FitResult& result) {
  if (result.branches.empty()) return {};
  std::string out =
      "<h2>Branches</h2>\n<div "
      "class=\"scroll\"><table>\n<tr><th>branch</th><th>chi-square</th><th>parameters</th><th>odds</th></tr>\n";
  for (const BranchResult& b : result.branches)
    out += fmt::format(
        "<tr><td class=\"name\">{}{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", escape_html(b.name),
        b.reported ? " (reported)" : "", plain(b.chi_square), b.parameters,
        b.odds < 1e-30 ? std::string("&lt; 10<sup>\u221230</sup>") : html_number(fmt::format("{:.2g}", b.odds)));
  return out +
         "</table></div>\n<p>Odds of the evidence: the likelihood, by the noise of the best branch, times the share of "
         "the bounds that the answer takes up.</p>\n";
}

std::string input_table(const FitResult& result) {
  constexpr std::size_t kMostInputs = 10, kMostParameters = 6;
  std::vector<std::size_t> shown;
  for (std::size_t j = 0; j < result.parameters.size() && shown.size() < kMostParameters; ++j)
    if (!result.parameters[j].linear && result.parameters[j].unit != "px" &&
        std::isfinite(result.parameters[j].stderr_))
      shown.push_back(j);
  if (shown.empty()) return {};
  std::string out = result.inputs.empty() && result.taken_as_exact.empty() ? "" : "<h2>What the values hang on</h2>\n";
  if (!result.taken_as_exact.empty()) out += list(result.taken_as_exact);
  if (result.inputs.empty()) return out;
  out +=
      "<p>What the estimates would change by if what was stated were otherwise; in brackets over the standard error. "
      "What is known to some standard deviation is in the errors; what is exact is not.</p>\n<div "
      "class=\"scroll\"><table>\n<tr><th>input</th><th>value</th><th>known to</th><th>more by</th>";
  for (const std::size_t j : shown) out += "<th>" + escape_html(short_name(result.parameters[j].name)) + "</th>";
  out += "</tr>\n";
  for (std::size_t i = 0; i < std::min(kMostInputs, result.inputs.size()); ++i) {
    const InputEffect& input = result.inputs[i];
    out += fmt::format("<tr><td class=\"name\">{}</td><td>{} {}</td><td>{}</td><td>{}</td>", escape_html(input.name),
                       html_number(fmt::format("{:.6g}", input.value)), escape_html(input.unit),
                       input.known_to > 0 ? html_number(fmt::format("{:.2g}", input.known_to)) : "exact",
                       input.unit == "deg" || input.unit == "px" ? "1 " + input.unit : "1 %");
    for (const std::size_t j : shown) {
      const ParameterEstimate& p = result.parameters[j];
      out += fmt::format("<td>{} ({})</td>", html_number(fmt::format("{:+.2g}", input.shift[j])),
                         html_number(fmt::format("{:+.{}f}", input.shift[j] / p.stderr_,
                                                 std::abs(input.shift[j]) < 10 * p.stderr_ ? 1 : 0)));
    }
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

/// Numbers of the instrument that the picture knows better than whoever stated them.
std::string stated_table(const FitResult& result) {
  std::string rows;
  for (const StatedNumber& n : result.stated)
    if (n.fitted)
      rows +=
          fmt::format("<tr><td class=\"name\">{}</td><td>{} \u00b1 {} {}</td><td>{} \u00b1 {}</td><td>{}</td></tr>\n",
                      escape_html(n.name), html_number(fmt::format("{:.6g}", n.stated)),
                      html_number(fmt::format("{:.2g}", n.known_to)), escape_html(n.unit),
                      html_number(fmt::format("{:.6g}", n.value)), html_number(fmt::format("{:.2g}", n.stderr_)),
                      html_number(fmt::format("{:+.1f}", n.away())));
  if (rows.empty()) return {};
  return "<h2>The instrument, as the picture has it</h2>\n<p>Stated, not known exactly, and fitted along; the last "
         "column "
         "is how far off in standard deviations of what was stated. Beyond three it is contradicted.</p>\n<div "
         "class=\"scroll\"><table>\n<tr><th>number</th><th>stated</th><th>found</th><th>away</th></tr>\n" +
         rows + "</table></div>\n";
}

std::string departures_table(const FitResult& result) {
  std::string rows;
  for (const Departure& d : result.departures)
    rows += fmt::format("<tr><td class=\"name\">{}</td><td>{} \u00b1 {} {}</td><td>{}</td></tr>\n", escape_html(d.name),
                        html_number(fmt::format("{:.2g}", d.value)), html_number(fmt::format("{:.2g}", d.stderr_)),
                        escape_html(d.unit), html_number(fmt::format("{:.2g}", d.usual)));
  if (rows.empty()) return {};
  return "<h2>How the picture departs from the model</h2>\n<p>Noise did not explain what the model left over: what "
         "pictures usually depart by was fitted along, all at once, in units of the gain. None of it is proven; the "
         "last "
         "column is its usual size.</p>\n<div class=\"scroll\"><table>\n<tr><th>departure</th><th>found</th>"
         "<th>usual</th></tr>\n" +
         rows + "</table></div>\n";
}

std::string coverage_table(const FitResult& result) {
  if (!result.coverage) return {};
  const Coverage& c = *result.coverage;
  std::string out = fmt::format(
      "<h2>Do the intervals hold?</h2>\n<p>{} images were simulated at this result ({}) and fitted from scratch: {} "
      "gave an answer, {} of these more than 5 standard errors off.</p>\n",
      c.draws,
      c.of_residuals ? "with the fit\u2019s own residuals as noise, drawn in blocks" : "with the noise as modelled",
      c.answered, c.wrong);
  if (c.answered == 0) return out;
  out +=
      "<div class=\"scroll\"><table>\n<tr><th>parameter</th><th>in 68 % interval</th><th>in 95 % "
      "interval</th><th>spread / std. error</th><th>bias / std. error</th></tr>\n";
  for (const Coverage::Of& p : c.parameters)
    out +=
        fmt::format("<tr><td class=\"name\">{}</td><td>{:.1f} %</td><td>{:.1f} %</td><td>{:.2f}</td><td>{}</td></tr>\n",
                    escape_html(short_name(p.name)), 100 * p.inside68, 100 * p.inside95, p.spread,
                    html_number(fmt::format("{:+.2f}", p.bias)));
  return out + fmt::format("</table></div>\n<p>Of {} fits: a fraction of 95 % is known to \u00b1{:.1g} %.</p>\n",
                           c.answered, 100 * std::sqrt(0.95 * 0.05 / c.answered));
}

std::string identifiability(const Config& config, const FitResult& result) {
  std::string out = "<h2>What the data determine</h2>\n";
  out += result.identifiable ? "<p>Every fitted parameter is determined by the data and the priors.</p>\n"
                             : "<p>Not every combination of the fitted parameters is determined by the data.</p>\n";
  if (!result.directions.empty()) {
    out += "<ul>\n";
    for (const FisherDirection& d : result.directions)
      if (!d.words.empty())
        out += "<li>" + std::string(d.identifiable ? "" : "<span class=\"flag\">not identifiable</span> ") +
               escape_html(d.words) + "</li>\n";
    out += "</ul>\n";
  }
  if (!result.rivals.empty()) {
    out +=
        "<h3>Rival minima, with their odds against the reported one</h3>\n<div class=\"scroll\"><table>\n<tr><th>odds "
        "against the reported "
        "minimum</th><th>likelihood ratio</th><th>chi-square</th>";
    std::vector<const ParameterEstimate*> shown;
    for (const ParameterEstimate& p : result.parameters)
      if (!p.linear && shown.size() < 6) shown.push_back(&p);
    for (const ParameterEstimate* p : shown)
      out += "<th>" + escape_html(short_name(p->name)) + (p->unit.empty() ? "" : " (" + pretty_unit(p->unit) + ")") +
             "</th>";
    out += "</tr>\n";
    for (const RivalMinimum& rival : result.rivals) {
      out += "<tr><td>" + html_number(fmt::format("{:.2g}", rival.odds)) + "</td><td>" +
             html_number(fmt::format("{:.2g}", rival.likelihood_ratio)) + "</td><td>" +
             html_number(fmt::format("{:.6g}", rival.chi_square)) + "</td>";
      for (const ParameterEstimate* p : shown) {
        const ParameterRef ref = config.job.parameters.find(p->name);
        out +=
            "<td>" +
            (ref && ref.index < std::ssize(rival.theta) ? value_html(rival.theta[ref.index], p->stderr_) : "\u2013") +
            "</td>";
      }
      out += "</tr>\n";
    }
    out += "</table></div>\n";
  }
  return out;
}

std::string model_section(const Config& config, const FitResult& result) {
  std::string out = "<h2>Model</h2>\n";
  const RenderPlan* previous = nullptr;
  for (const MicrographResult& m : result.micrographs) {
    const RenderPlan& plan = m.plan;
    if (later_row(config, static_cast<std::size_t>(&m - result.micrographs.data()))) continue;
    if (previous != nullptr && previous->method == plan.method && previous->physics == plan.physics &&
        previous->reasons == plan.reasons)
      continue;  // frames of one series share it
    previous = &plan;
    if (result.micrographs.size() > 1)
      out += "<h3>" + escape_html(m.name) + (&m == &result.micrographs[0] ? " and those like it" : "") + "</h3>\n";
    out += "<dl class=\"facts\">\n" + fact("method", escape_html(plan.method)) +
           fact("physics", escape_html(plan.physics)) +
           fact("numerical error",
                html_number(fmt::format("{:.2g}", plan.numerical_error)) + " of the incident intensity") +
           fact("model error", html_number(fmt::format("{:.2g}", plan.model_error)) +
                                   " of the incident intensity, from what the physics leaves out") +
           "</dl>\n";
    if (!plan.reasons.empty()) out += list(plan.reasons);
    std::vector<std::string> not_modelled = plan.warnings;
    not_modelled.insert(not_modelled.end(), plan.left_out.begin(), plan.left_out.end());
    if (!not_modelled.empty()) out += "<p>Not modelled:</p>\n" + list(not_modelled);
  }
  return out;
}

std::string data_section(const Config& config, const FitResult& result) {
  std::string out =
      "<h2>Data</h2>\n<p>Pixels used and left out, by reason; noise model in counts.</p>\n<div class=\"scroll\"><table "
      "class=\"full\">\n<tr><th>micrograph</th><th>used</th><th>masked</th>"
      "<th>outside<br>ROI</th><th>satu-<br>rated</th><th>dead</th><th>not<br>finite</th><th>out-<br>liers</"
      "th><th>chi-square<br>per "
      "pixel</th>"
      "<th>read<br>noise</th><th>counts per<br>photon</th></tr>\n";
  for (std::size_t i = 0; i < result.micrographs.size(); ++i) {
    if (later_row(config, i)) continue;
    const MicrographResult& m = result.micrographs[i];
    const Picture none;
    const Picture* of = picture_at(config.job.measurements, i);
    const Picture& input = of ? *of : none;
    out += fmt::format(
        "<tr><td class=\"name "
        "file\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
        "<td>{}{}</td><td>{}</td></tr>\n",
        escape_html(m.name), m.used, input.masked_by_user, input.outside_roi + m.outside, input.saturated, input.dead,
        input.non_finite, m.outliers, m.used > 0 ? plain(m.chi_square / m.used) : "\u2013", plain(m.noise.read_counts),
        m.noise.estimated ? "*" : "", plain(m.noise.counts_per_photon));
  }
  out += "</table></div>\n";
  if (std::any_of(result.micrographs.begin(), result.micrographs.end(),
                  [](const auto& m) { return m.noise.estimated; }))
    out += "<p><small>* noise estimated from the image itself</small></p>\n";
  return out;
}

std::string statistics_section(const Config& config, const FitResult& result) {
  std::string out = "<dl class=\"facts\">\n";
  if (!result.covariance_kind.empty()) out += fact("standard errors", escape_html(result.covariance_kind));
  out += fact("95 % intervals", std::isfinite(result.interval_degrees_of_freedom)
                                    ? "Student t, " + plain(result.interval_degrees_of_freedom) + " degrees of freedom"
                                    : "normal distribution");
  if (result.frame_scatter)
    out += fact("scatter between frames", format_percent(result.frame_scatter->intensity_sd) + " of the intensity, " +
                                              plain(result.frame_scatter->degrees_of_freedom) + " degrees of freedom");
  if (config.job.prior) {
    std::string names;
    for (const std::string& name : config.job.prior->names) names += (names.empty() ? "" : ", ") + name;
    out += fact("joint prior", escape_html(names) + " from " + escape_html(config.job.prior->source));
  }
  return out + "</dl>\n";
}

}  // namespace birefit::page
