// What a fit leaves behind: fit.json, images, config echo, log and the summary on stdout.

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "birefit/io.h"
#include "io/report/format.h"
#include "io/results/fit_file.h"
#include "io/results/provenance.h"
#include "io/results/residual.h"
#include "io/results/write.h"

namespace birefit {
namespace {

using Json = nlohmann::ordered_json;

/// Of fit.json (docs/fit_json.md): grows when a key goes away or means something else.
constexpr int kSchema = 1;
constexpr double kNotableCorrelation = 0.5;
constexpr std::size_t kListedCorrelations = 12;

/// JSON has no NaN and no infinity: null.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json matrix(const std::vector<std::string>& names, const Eigen::MatrixXd& values) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < values.cols(); ++j) row.push_back(number(values(i, j)));
    rows.push_back(std::move(row));
  }
  return {{"names", names}, {"matrix", std::move(rows)}};
}

Json parameter_json(const ParameterEstimate& p) {
  Json json = {{"value", number(p.value)},
               {"stderr", number(p.stderr_)},
               {"unit", p.unit},
               {"start", number(p.start)},
               {"bounds", {number(p.lower), number(p.upper)}},
               {"at_bound", p.at_bound},
               {"limit", nullptr},
               {"interval_95", {number(p.interval95_low), number(p.interval95_high)}},
               {"interval_kind", p.profiled         ? "profile likelihood"
                                 : !p.limit.empty() ? "one-sided"
                                                    : "normal"},
               {"prior", nullptr},
               {"linear", p.linear}};
  if (!p.limit.empty()) json["limit"] = {{"side", p.limit}, {"value", number(p.limit_value)}};
  if (p.prior_sd) json["prior"] = {{"value", number(p.prior_value.value_or(p.start))}, {"sd", number(*p.prior_sd)}};
  return json;
}

Json departures_json(const FitResult& result) {
  Json list = Json::array();
  for (const Departure& d : result.departures)
    list.push_back({{"name", d.name},
                    {"unit", d.unit},
                    {"value", number(d.value)},
                    {"stderr", number(d.stderr_)},
                    {"usual", number(d.usual)}});
  return list;
}

Json stated_json(const FitResult& result) {
  Json list = Json::array();
  for (const StatedNumber& n : result.stated) {
    Json json = {{"name", n.name}, {"unit", n.unit}, {"value", number(n.stated)}, {"known_to", number(n.known_to)}};
    json["fitted"] = n.fitted ? Json{{"value", number(n.value)}, {"stderr", number(n.stderr_)}} : Json(nullptr);
    json["share_of_variance"] = number(n.share);
    json["of"] = n.most_of.empty() ? Json(nullptr) : Json(n.most_of);
    list.push_back(std::move(json));
  }
  return list;
}

Json derived_json(const FitResult& result) {
  Json list = Json::array();
  for (const DerivedEstimate& d : result.derived) {
    Json slopes = Json::array();
    for (const double by : d.by) slopes.push_back(number(by));
    list.push_back({{"name", d.name},
                    {"expression", d.expression},
                    {"tied", d.tied},
                    {"unit", d.unit},
                    {"value", number(d.value)},
                    {"stderr", number(d.stderr_)},
                    {"interval_95", {number(d.interval95_low), number(d.interval95_high)}},
                    {"slopes", std::move(slopes)}});
  }
  return list;
}

Json plan_json(const RenderPlan& plan) {
  return {{"method", plan.method},
          {"physics", plan.physics},
          {"reasons", plan.reasons},
          {"numerical_error", number(plan.numerical_error)},
          {"model_error", number(plan.model_error)},
          {"warnings", plan.warnings},
          {"left_out", plan.left_out}};
}

struct PixelCounts {
  long used = 0, outliers = 0, masked = 0, saturated = 0, dead = 0, non_finite = 0, outside_roi = 0;
};

PixelCounts pixels_of(const Config& config, const FitResult& result, std::size_t i) {
  PixelCounts counts;
  if (i < result.micrographs.size())
    counts.used = result.micrographs[i].used, counts.outliers = result.micrographs[i].outliers;
  if (const Picture* picture = picture_at(config.job.measurements, i)) {
    const Picture& m = *picture;
    counts.masked = m.masked_by_user;
    counts.saturated = m.saturated;
    counts.dead = m.dead;
    counts.non_finite = m.non_finite;
    counts.outside_roi = m.outside_roi + (i < result.micrographs.size() ? result.micrographs[i].outside : 0);
  }
  return counts;
}

Json pixels_json(const PixelCounts& c) {
  return {{"used", c.used},        {"masked", c.masked},         {"saturated", c.saturated},
          {"dead", c.dead},        {"non_finite", c.non_finite}, {"outside_roi", c.outside_roi},
          {"outliers", c.outliers}};
}

Json strips_json(const FitResult& result) {
  Json strips = Json::array();
  for (const Strip& strip : result.strips) {
    Json values;
    for (std::size_t j = 0; j < strip.value.size(); ++j)
      values[result.parameters[j].name] = {{"value", number(strip.value[j])}, {"stderr", number(strip.stderr_[j])}};
    strips.push_back({{"roi_px", strip.roi_px},
                      {"frame_scatter", number(strip.frame_scatter)},
                      {"reduced_chi_square", number(strip.reduced_chi_square)},
                      {"parameters", values}});
  }
  return {{"list", strips}, {"trusted_roi_px", result.trusted_px ? Json(*result.trusted_px) : Json(nullptr)}};
}

Json rivals_json(const Config& config, const FitResult& result) {
  Json list = Json::array();
  for (const RivalMinimum& rival : result.rivals) {
    Json values = Json::object();
    for (const ParameterEstimate& p : result.parameters)
      if (const ParameterRef ref = config.job.parameters.find(p.name); ref && ref.index < std::ssize(rival.theta))
        values[p.name] = number(rival.theta[ref.index]);
    list.push_back({{"odds", number(rival.odds)},
                    {"likelihood_ratio", number(rival.likelihood_ratio)},
                    {"counts", rival.counts},
                    {"chi_square", number(rival.chi_square)},
                    {"parameters", values}});
  }
  return list;
}

Json branches_json(const FitResult& result) {
  Json list = Json::array();
  for (const BranchResult& branch : result.branches)
    list.push_back({{"name", branch.name},
                    {"chi_square", number(branch.chi_square)},
                    {"parameters", branch.parameters},
                    {"odds", number(branch.odds)},
                    {"reported", branch.reported}});
  return list;
}

Json directions_json(const FitResult& result) {
  Json list = Json::array();
  for (const FisherDirection& direction : result.directions) {
    Json weights = Json::object();
    for (const auto& [name, weight] : direction.weights) weights[name] = number(weight);
    list.push_back({{"words", direction.words},
                    {"identifiable", direction.identifiable},
                    {"stderr", number(direction.stderr_)},
                    {"weights", weights}});
  }
  return list;
}

Json inputs_json(const FitResult& result) {
  Json list = Json::array();
  for (const InputEffect& input : result.inputs) {
    Json shift = Json::object();
    for (std::size_t j = 0; j < input.shift.size() && j < result.parameters.size(); ++j)
      shift[result.parameters[j].name] = number(input.shift[j]);
    list.push_back({{"name", input.name},
                    {"unit", input.unit},
                    {"value", number(input.value)},
                    {"step", number(input.step)},
                    {"known_to", number(input.known_to)},
                    {"shift", shift}});
  }
  return list;
}

Json coverage_json(const FitResult& result) {
  const auto& c = result.coverage;
  if (!c) return nullptr;
  Json of = Json::object();
  for (const Coverage::Of& p : c->parameters)
    of[p.name] = {{"inside68", number(p.inside68)},
                  {"inside95", number(p.inside95)},
                  {"spread_over_stderr", number(p.spread)},
                  {"bias_over_stderr", number(p.bias)}};
  return {{"draws", c->draws},
          {"noise", c->of_residuals ? "residuals" : "model"},
          {"answered", c->answered},
          {"confidently_wrong", c->wrong},
          {"parameters", of}};
}

Json samples_json(const FitResult& result) {
  const auto& s = result.samples;
  if (!s) return nullptr;
  Json of = Json::object();
  for (const Samples::Of& p : s->parameters)
    of[p.name] = {{"median", number(p.median)}, {"middle_95", {number(p.low), number(p.high)}}};
  return {{"draws", s->values.rows()},
          {"effective", number(s->effective)},
          {"autocorrelation", number(s->autocorrelation)},
          {"accepted", number(s->accepted)},
          {"parameters", of}};
}

std::string unit_suffix(const std::string& unit) { return unit.empty() ? "" : " " + unit; }

std::string parameter_line(const ParameterEstimate& p, std::size_t name_width) {
  std::string line = fmt::format("  {:<{}} = ", p.name, name_width);
  if (!p.limit.empty())
    line += fmt::format("{} {:.4g}{} (95 % {} limit; best {:.4g})", p.limit == "upper" ? "<" : ">", p.limit_value,
                        unit_suffix(p.unit), p.limit, p.value);
  else if (std::isfinite(p.stderr_))
    line += fmt::format("{} +/- {}{} ({}) [95%: {} .. {}]", format_value(p.value, p.stderr_), format_error(p.stderr_),
                        unit_suffix(p.unit), p.value != 0 ? format_percent(p.stderr_ / p.value) : "-",
                        format_value(p.interval95_low, p.stderr_), format_value(p.interval95_high, p.stderr_));
  else
    line += fmt::format("{:.6g}{} +/- not known", p.value, unit_suffix(p.unit));
  if (p.profiled) line += " by profile";
  if (!p.linear) line += fmt::format(" (start {:.6g})", p.start);
  if (p.at_bound && p.limit.empty()) line += " AT ITS BOUND";
  return line;
}

std::string derived_line(const DerivedEstimate& d, std::size_t name_width) {
  std::string line = fmt::format("  {:<{}} = ", d.name, name_width);
  if (std::isfinite(d.stderr_) && d.stderr_ > 0)
    line += fmt::format("{} +/- {}{} ({}) [95%: {} .. {}]", format_value(d.value, d.stderr_), format_error(d.stderr_),
                        unit_suffix(d.unit), d.value != 0 ? format_percent(d.stderr_ / std::abs(d.value)) : "-",
                        format_value(d.interval95_low, d.stderr_), format_value(d.interval95_high, d.stderr_));
  else
    line += fmt::format("{:.6g}{}{}", d.value, unit_suffix(d.unit), d.stderr_ == 0 ? "" : " +/- not known");
  return line + " = " + d.expression;
}

std::string coverage_text(const Coverage& c) {
  std::string text = fmt::format(
      "  {} images simulated at this result ({}) and fitted from scratch: {} with an answer, {} of them more than 5 "
      "standard errors off\n",
      c.draws, c.of_residuals ? "noise: the fit's own residuals, drawn in blocks" : "noise as modelled", c.answered,
      c.wrong);
  if (c.answered == 0) return text;
  std::size_t width = 0;
  for (const Coverage::Of& p : c.parameters) width = std::max(width, p.name.size());
  for (const Coverage::Of& p : c.parameters)
    text += fmt::format(
        "    {:<{}}  68 % interval holds {:.1f} %, 95 % interval {:.1f} %; spread {:.2f}, bias {:+.2f} standard "
        "errors\n",
        p.name, width, 100 * p.inside68, 100 * p.inside95, p.spread, p.bias);
  return text + fmt::format("    (of {} fits; a fraction of 95 % is known to {:.1g} %)\n", c.answered,
                            100 * std::sqrt(0.95 * 0.05 / c.answered));
}

std::string samples_text(const FitResult& result) {
  const Samples& s = *result.samples;
  std::string text = fmt::format(
      "  {} draws from the posterior, worth {:.0f} independent ones (autocorrelation {:.2g} steps, {:.0f} % "
      "accepted)\n",
      s.values.rows(), s.effective, s.autocorrelation, 100 * s.accepted);
  std::size_t width = 0;
  for (const Samples::Of& p : s.parameters) width = std::max(width, p.name.size());
  for (const Samples::Of& p : s.parameters) {
    const double half = 0.25 * (p.high - p.low);
    text += fmt::format("    {:<{}}  median {}, 95 % of them {} .. {}\n", p.name, width, format_value(p.median, half),
                        format_value(p.low, half), format_value(p.high, half));
  }
  return text;
}

}  // namespace

std::string fit_json(const Config& config, const FitResult& result) {
  Json json;
  json["schema"] = kSchema;
  json["made_by"] = made_by(config);
  json["run"] = this_run(result.seconds);
  json["config"] = {{"file", printable(config.path.string())}, {"text", config.text}};
  if (!config.fingerprint.empty()) json["fingerprint"] = config.fingerprint;
  json["has_answer"] = result.has_answer();
  json["grade"] = result.grade();
  json["misfit"] = result.misfit;
  json["verdict"] = result.verdict;
  json["converged"] = result.converged;
  json["interrupted"] = result.interrupted;
  json["pinned"] = result.pinned;
  json["described"] = result.described;
  json["left_over"] = number(result.left_over);
  json["ambiguous"] = result.ambiguous;
  json["rivals"] = rivals_json(config, result);
  json["branches"] = branches_json(result);
  json["identifiable"] = result.identifiable;
  json["directions"] = directions_json(result);
  json["inputs"] = inputs_json(result);
  json["stated"] = stated_json(result);
  json["departures"] = departures_json(result);
  json["parameters"] = Json::object();
  for (const ParameterEstimate& p : result.parameters) json["parameters"][p.name] = parameter_json(p);
  json["derived"] = derived_json(result);
  json["coverage"] = coverage_json(result);
  json["samples"] = samples_json(result);
  json["correlation"] = matrix(result.names, result.correlation);
  json["covariance"] = matrix(result.names, result.covariance);
  json["stated_covariance"] = matrix(result.names, result.stated_covariance);
  json["covariance_kind"] = result.covariance_kind;
  json["interval_degrees_of_freedom"] = number(result.interval_degrees_of_freedom);
  json["frame_scatter"] = nullptr;
  if (result.frame_scatter)
    json["frame_scatter"] = {{"intensity_sd", number(result.frame_scatter->intensity_sd)},
                             {"degrees_of_freedom", number(result.frame_scatter->degrees_of_freedom)}};
  json["joint_prior"] = nullptr;
  if (config.job.prior)
    json["joint_prior"] = {{"source", config.job.prior->source}, {"parameters", config.job.prior->names}};
  json["chi_square"] = number(result.chi_square);
  json["reduced_chi_square"] = number(result.reduced_chi_square);
  json["degrees_of_freedom"] = result.degrees_of_freedom;
  json["residual_rms"] = number(residual_fraction(result));

  PixelCounts total;
  Json micrographs = Json::array();
  RenderPlan model;
  for (std::size_t i = 0; i < result.micrographs.size(); ++i) {
    const MicrographResult& m = result.micrographs[i];
    const PixelCounts counts = pixels_of(config, result, i);
    total.used += counts.used, total.masked += counts.masked, total.saturated += counts.saturated;
    total.dead += counts.dead, total.non_finite += counts.non_finite, total.outside_roi += counts.outside_roi,
        total.outliers += counts.outliers;
    if (i == 0) model = m.plan;
    model.numerical_error = std::max(model.numerical_error, m.plan.numerical_error);
    model.model_error = std::max(model.model_error, m.plan.model_error);
    micrographs.push_back({{"name", m.name},
                           {"width", m.fitted.width()},
                           {"height", m.fitted.height()},
                           {"chi_square", number(m.chi_square)},
                           {"residual_rms", number(m.residual_rms)},
                           {"residual_rms_fraction", number(residual_fraction(m))},
                           {"signal_range", number(m.signal_range)},
                           {"noise",
                            {{"read_counts", number(m.noise.read_counts)},
                             {"counts_per_photon", number(m.noise.counts_per_photon)},
                             {"black_counts", number(m.noise.black_counts)},
                             {"estimated", m.noise.estimated}}},
                           {"pixels", pixels_json(counts)},
                           {"model", plan_json(m.plan)}});
  }
  json["pixels"] = pixels_json(total);
  json["micrographs"] = std::move(micrographs);
  json["model"] = plan_json(model);
  json["evaluations"] = result.evaluations;
  if (!result.strips.empty()) json["strips"] = strips_json(result);
  json["warnings"] = result.warnings;
  json["taken_as_exact"] = result.taken_as_exact;
  json["checksum"] = checksum_of(nlohmann::json(json));
  // File names and configs may hold bytes that are no UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string summary(const FitResult& result) {
  std::string text;
  std::size_t width = 0;
  for (const ParameterEstimate& p : result.parameters) width = std::max(width, p.name.size());
  for (const ParameterEstimate& p : result.parameters) text += parameter_line(p, width) + "\n";
  width = 0;
  for (const DerivedEstimate& d : result.derived) width = std::max(width, d.name.size());
  if (!result.derived.empty()) text += "  what follows from them\n";
  for (const DerivedEstimate& d : result.derived) text += derived_line(d, width) + "\n";

  text += fmt::format("  reduced chi-square {:.4g} ({} degrees of freedom), residual rms {}\n",
                      result.reduced_chi_square, result.degrees_of_freedom, describe_residual(result));

  struct Pair {
    double correlation;
    std::string names;
  };
  std::vector<Pair> pairs;
  const Eigen::Index count = std::min<Eigen::Index>(result.correlation.rows(), std::ssize(result.names));
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = i + 1; j < count; ++j)
      if (const double c = result.correlation(i, j); std::abs(c) > kNotableCorrelation)
        pairs.push_back({c, short_name(result.names[i]) + " and " + short_name(result.names[j])});
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return std::abs(a.correlation) > std::abs(b.correlation); });
  if (!pairs.empty()) text += "  correlations\n";
  for (std::size_t i = 0; i < std::min(pairs.size(), kListedCorrelations); ++i) {
    // -0.999998 must not be rounded to -1.
    const double left = 1 - std::abs(pairs[i].correlation);
    const int digits = left > 0 && left < 0.005 ? std::min(9, 1 - static_cast<int>(std::floor(std::log10(left)))) : 2;
    text += fmt::format("    {:+.{}f}  {}\n", pairs[i].correlation, digits, pairs[i].names);
  }
  if (pairs.size() > kListedCorrelations)
    text +=
        fmt::format("    and {} more above {} in fit.json\n", pairs.size() - kListedCorrelations, kNotableCorrelation);

  if (!result.verdict.empty()) text += result.verdict + "\n";
  if (result.coverage) text += coverage_text(*result.coverage);
  if (result.samples) text += samples_text(result);
  for (const std::string& warning : result.warnings) text += "warning: " + warning + "\n";
  for (const std::string& sentence : result.taken_as_exact) text += "taken as exact: " + sentence + "\n";
  return printable_lines(text);
}

std::string log_text(const Config& config, const FitResult& result) {
  std::string text =
      fmt::format("birefit {}\nconfig: {}\n\n{}\n", BIREFIT_VERSION, printable(config.path.string()), summary(result));
  for (std::size_t i = 0; i < result.micrographs.size(); ++i) {
    const MicrographResult& m = result.micrographs[i];
    const bool row =
        std::none_of(config.signals.begin(), config.signals.end(), [&](const SignalTable& t) { return t.first == i; });
    if (!config.signals.empty() && row) continue;  // the first row of a table speaks for the others
    text += fmt::format("\nmicrograph {}\n  {} pixels used, chi-square {:.6g}, residual rms {:.4g}\n", m.name, m.used,
                        m.chi_square, m.residual_rms);
    text += fmt::format("  noise: read {:.4g} counts, {:.4g} counts per photon{}{}\n", m.noise.read_counts,
                        m.noise.counts_per_photon,
                        m.noise.black_counts != 0 ? fmt::format(" above {:.4g} counts", m.noise.black_counts) : "",
                        m.noise.estimated ? " (estimated from the image)" : "");
    text += fmt::format("  method {} ({}), numerical error {:.2g}, model error {:.2g}\n", m.plan.method, m.plan.physics,
                        m.plan.numerical_error, m.plan.model_error);
    for (const std::string& reason : m.plan.reasons) text += "    " + reason + "\n";
  }
  text += "\nscan\n";
  for (const ScanTrace& scan : result.scans) {
    text += "  " + scan.name + "\n";
    for (std::size_t i = 0; i < std::min(scan.value.size(), scan.chi_square.size()); ++i)
      text += fmt::format("    {:>14.8g} {:>16.8g}\n", scan.value[i], scan.chi_square[i]);
  }
  text += "\niterations\n       chi-square             step\n";
  for (const Iteration& i : result.iterations)
    text += fmt::format("  {:>3} {:>16.10g} {:>12.4g}\n", i.number, i.chi_square, i.step);
  text += fmt::format("\n{} evaluations, {:.3f} s\n\nsolver\n{}\n", result.evaluations, result.seconds,
                      result.solver_report);
  return printable_lines(text);
}

}  // namespace birefit
