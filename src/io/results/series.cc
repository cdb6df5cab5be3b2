#include "birefit/series.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "io/config/reader.h"
#include "io/config/series.h"
#include "io/files/csv.h"
#include "io/files/whole_file.h"
#include "io/results/provenance.h"

namespace birefit {
namespace {

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

Posterior posterior_of(const FitResult& fit) {
  Posterior all{fit.names, Eigen::VectorXd::Constant(std::ssize(fit.names), kNotKnown), fit.covariance,
                fit.interval_degrees_of_freedom};
  for (const ParameterEstimate& p : fit.parameters)
    for (std::size_t i = 0; i < fit.names.size(); ++i)
      if (fit.names[i] == p.name) all.mean[static_cast<Eigen::Index>(i)] = p.value;
  return all;
}

/// Without what is stated, which all frames have in common and which no number of frames makes smaller.
Posterior own_posterior_of(const FitResult& fit) {
  Posterior own = posterior_of(fit);
  if (fit.stated_covariance.rows() == own.covariance.rows()) own.covariance -= fit.stated_covariance;
  return marginal(own, own.names) ? own : posterior_of(fit);
}

/// What the config itself knows of the shared parameters, the same in every frame.
std::optional<Posterior> shared_prior(const Config& frame, const std::vector<std::string>& names) {
  const std::optional<JointPrior>& joint = frame.job.prior;
  Posterior prior;
  prior.degrees_of_freedom = std::numeric_limits<double>::infinity();
  std::vector<double> mean, variance;
  for (const std::string& name : names) {
    const Parameter& parameter = frame.job.parameters[frame.job.parameters.find(name)];
    if (!parameter.prior_sd) continue;
    prior.names.push_back(name);
    mean.push_back(parameter.value);
    variance.push_back(*parameter.prior_sd * *parameter.prior_sd);
  }
  const auto single = std::ssize(mean);
  const bool correlated = joint && std::find(names.begin(), names.end(), joint->names.front()) != names.end();
  const Eigen::Index all = single + (correlated ? joint->mean.size() : 0);
  if (all == 0) return std::nullopt;
  prior.mean.resize(all);
  prior.covariance = Eigen::MatrixXd::Zero(all, all);
  for (Eigen::Index i = 0; i < single; ++i)
    prior.mean[i] = mean[static_cast<std::size_t>(i)], prior.covariance(i, i) = variance[static_cast<std::size_t>(i)];
  if (correlated) {
    prior.names.insert(prior.names.end(), joint->names.begin(), joint->names.end());
    prior.mean.tail(joint->mean.size()) = joint->mean;
    prior.covariance.bottomRightCorner(joint->mean.size(), joint->mean.size()) = joint->covariance;
    prior.degrees_of_freedom = joint->degrees_of_freedom;
  }
  return prior;
}

void check_shared(const ImageSeries& series, const Config& frame) {
  Problems problems;
  std::vector<std::string> fitted;
  const ParameterTable& table = frame.job.parameters;
  for (int i = 0; i < table.size(); ++i)
    if (table[i].free) fitted.push_back(table[i].name);
  for (const auto& [name, where] : series.shared) {
    if (std::find(fitted.begin(), fitted.end(), name) != fitted.end()) continue;
    const std::string near = nearest_word(name, fitted);
    const bool known = static_cast<bool>(table.find(name));
    problems.add(where, name + (known ? " is not fitted here" : " is no parameter of this config"),
                 known          ? "give it {value: .., fit: [low, high]}"
                 : near.empty() ? "fitted here: " + list_words(fitted)
                                : "did you mean " + near + "?");
  }
  // A prior between a shared parameter and one of each frame's own would be counted once a frame.
  if (frame.job.prior) {
    const auto is_shared = [&](const std::string& name) {
      return std::any_of(series.shared.begin(), series.shared.end(), [&](const auto& s) { return s.first == name; });
    };
    const auto& names = frame.job.prior->names;
    const auto shared = std::find_if(names.begin(), names.end(), is_shared),
               own = std::find_if_not(names.begin(), names.end(), is_shared);
    if (shared != names.end() && own != names.end())
      problems.add(
          {series.path.string()},
          "prior connects " + *shared + ", which is shared, with " + *own + ", which each frame has for itself",
          "share both or neither");
  }
  problems.throw_if_any();
}

/// What was found, in a line.
std::string reason_of(const UserError& error) {
  std::string words;
  for (const Problem& problem : error.problems()) words += (words.empty() ? "" : "; ") + problem.what;
  return words;
}

std::string cell(double value) { return std::isfinite(value) ? fmt::format("{:.10g}", value) : std::string(); }

/// value, stderr, low95, high95; of a limit only the side that is known.
std::string cells(const ParameterEstimate& p) {
  const bool limited = !p.limit.empty();
  return cell(p.value) + "," + (limited ? "" : cell(p.stderr_)) + "," +
         (!limited             ? cell(p.interval95_low)
          : p.limit == "lower" ? cell(p.limit_value)
                               : "") +
         "," +
         (!limited             ? cell(p.interval95_high)
          : p.limit == "upper" ? cell(p.limit_value)
                               : "");
}

/// What follows from a frame's numbers, once other frames have moved these: to first order. `all` is in the order of
/// the fit's own names.
void move_derived(FitResult& fit, const Posterior& all, double t) {
  Eigen::VectorXd change(static_cast<Eigen::Index>(fit.names.size()));
  for (std::size_t k = 0; k < fit.names.size(); ++k) change[static_cast<Eigen::Index>(k)] = 0;
  for (const ParameterEstimate& p : fit.parameters) {
    const auto here = std::find(fit.names.begin(), fit.names.end(), p.name) - fit.names.begin(),
               there = std::find(all.names.begin(), all.names.end(), p.name) - all.names.begin();
    if (here < change.size() && there < all.mean.size()) change[here] = all.mean[there] - p.value;
  }
  for (DerivedEstimate& d : fit.derived) {
    if (d.by.size() != change.size() || all.covariance.rows() != fit.covariance.rows()) continue;
    const double before = d.by.dot(fit.covariance * d.by), after = d.by.dot(all.covariance * d.by);
    d.value += d.by.dot(change);
    if (!std::isfinite(d.stderr_)) continue;  // what is not known stays so
    d.stderr_ = std::sqrt(std::max(0.0, d.stderr_ * d.stderr_ - before + after));
    d.interval95_low = d.value - t * d.stderr_;
    d.interval95_high = d.value + t * d.stderr_;
  }
}

}  // namespace

ImageSeries load_series(const std::filesystem::path& path, const std::vector<std::string>& set) {
  ImageSeries series = read_series(path, read_text(path), set);
  if (!series.own.empty())
    throw UserError(series.own[0].second, "micrographs.own is of one fit of all images (birefit fit)",
                    "every frame of a series has for itself what shared: [..] does not name: leave own out");
  constexpr std::size_t kMostProblems = 50;
  Problems problems, of_first;
  // What is wrong with the config shows in the first frame that can be read; the others' mistakes are their own.
  bool sound = false;
  for (std::size_t i = 0; i < series.frames.size() && problems.all().size() < kMostProblems; ++i) {
    if (const SeriesFrame& frame = series.frames[i]; !frame.unreadable.empty()) {
      if (i == 0) of_first.add(frame.where, frame.unreadable);
      continue;
    }
    try {
      if (sound) {
        check_frame(series, i);
      } else {
        check_shared(series, load_frame(series, i));
        sound = true;
      }
    } catch (const FrameError& error) {
      series.frames[i].unreadable = reason_of(error);
      if (i == 0) of_first.add(error);
    } catch (const UserError& error) {
      if (!sound) throw;
      problems.add(error);
    }
  }
  problems.throw_if_any();
  if (!sound && series.frames.size() > 1)
    of_first.add({series.path.string()},
                 fmt::format("none of the {} frames can be read: what is said is of the first", series.frames.size()));
  if (!sound) of_first.throw_if_any();
  return series;
}

std::optional<Config> open_frame(ImageSeries& series, std::size_t frame) {
  std::string& unreadable = series.frames[frame].unreadable;
  if (!unreadable.empty()) return std::nullopt;
  try {
    return load_frame(series, frame);
  } catch (const UserError& error) {  // the config is sound: it is this image in which nothing is found
    unreadable = reason_of(error);
    return std::nullopt;
  }
}

std::size_t first_readable(const ImageSeries& series) {
  const auto found = std::find_if(series.frames.begin(), series.frames.end(),
                                  [](const SeriesFrame& frame) { return frame.unreadable.empty(); });
  return found == series.frames.end() ? 0 : static_cast<std::size_t>(found - series.frames.begin());
}

void start_from(Config& frame, const FitResult& neighbour) {
  for (const ParameterEstimate& p : neighbour.parameters) {
    const ParameterRef ref = frame.job.parameters.find(p.name);
    if (!ref || p.at_bound || !p.limit.empty() || !std::isfinite(p.value)) continue;
    Parameter& parameter = frame.job.parameters[ref];
    const auto& joint = frame.job.prior;
    const bool prior = parameter.prior_sd ||
                       (joint && std::find(joint->names.begin(), joint->names.end(), p.name) != joint->names.end());
    if (!parameter.free || parameter.linear || parameter.automatic || prior) continue;
    parameter.value = std::clamp(p.value, parameter.lower, parameter.upper);
  }
}

std::string fingerprint_of(const Config& frame) {
  // Lengths before texts: no two lists of facts make the same one.
  std::string facts;
  const auto add = [&](const std::string& text) { facts += fmt::format("{}:{}", text.size(), text); };
  nlohmann::ordered_json made = made_by(frame);
  for (nlohmann::ordered_json& file : made["files"]) file.erase("file");  // the same wherever it lies
  add(made.dump());
  add(frame.text);
  const ParameterTable& table = frame.job.parameters;  // the row's numbers and the starts are in it
  for (int i = 0; i < table.size(); ++i) {
    add(table[i].name);
    for (const double number : {table[i].value, table[i].lower, table[i].upper, table[i].free ? 1.0 : 0.0})
      add(fmt::format("{}", number));
  }
  return sha256(facts).substr(0, 16);
}

bool SeriesResult::has_answer() const {
  return std::all_of(frames.begin(), frames.end(), [](const auto& fit) { return fit && fit->has_answer(); });
}

namespace {

/// What all fits together move by where each by itself has moved by one: a prior that holds each back counts once.
/// `posteriors` are those that were combined.
Eigen::MatrixXd moved_together(const std::vector<Posterior>& posteriors, const SharedEstimate& shared) {
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(shared.posterior.mean.size(), shared.posterior.mean.size());
  for (const Posterior& own : posteriors) information += own.covariance.inverse();
  const double scaled = shared.consistent ? 1 : shared.chi_square / shared.chi_square_degrees;
  return shared.posterior.covariance * information / scaled;
}

/// Of a covariance that all frames have in common what it is of this one's numbers, once the shared ones follow all
/// frames: its own follow these.
Eigen::MatrixXd in_common_after(const Posterior& own, const std::vector<Eigen::Index>& of_shared,
                                const Eigen::MatrixXd& together, const Eigen::MatrixXd& in_common) {
  const Eigen::Index all = own.covariance.rows(), q = std::ssize(of_shared);
  const Eigen::MatrixXd follows =
      own.covariance(Eigen::all, of_shared) * Eigen::MatrixXd(own.covariance(of_shared, of_shared)).inverse();
  Eigen::MatrixXd moves = Eigen::MatrixXd::Identity(all, all);
  moves(Eigen::all, of_shared) += follows * (together - Eigen::MatrixXd::Identity(q, q));
  return moves * in_common * moves.transpose();
}

}  // namespace

SeriesResult settle_series(const ImageSeries& series, std::vector<std::optional<FitResult>> fits) {
  SeriesResult result;
  result.frames = fits;
  result.alone = std::move(fits);
  if (series.shared.empty()) return result;
  std::vector<std::string> names;
  for (const auto& [name, unused] : series.shared) names.push_back(name);

  std::vector<Posterior> posteriors;
  std::vector<bool> heard(result.alone.size(), false);
  std::size_t done = 0;
  for (std::size_t i = 0; i < result.alone.size(); ++i) {
    if (!result.alone[i]) continue;
    ++done;
    const FitResult& fit = *result.alone[i];
    const bool limited = std::any_of(fit.parameters.begin(), fit.parameters.end(), [&](const ParameterEstimate& p) {
      return !p.limit.empty() && std::find(names.begin(), names.end(), p.name) != names.end();
    });
    if (!fit.has_answer() || limited) continue;
    if (auto one = marginal(own_posterior_of(fit), names)) {
      posteriors.push_back(std::move(*one));
      heard[i] = true;
    }
  }
  if (posteriors.size() < done)
    result.warnings.push_back(
        fmt::format("{} of {} frames say nothing of the shared parameters: they have no answer, or only a limit.",
                    done - posteriors.size(), done));
  if (posteriors.empty()) return result;
  SharedEstimate shared = combine(posteriors, shared_prior(load_frame(series, first_readable(series)), names));
  if (!shared.consistent)
    result.warnings.push_back(fmt::format(
        "The frames disagree on what they share: chi-square {:.4g} for {} degrees of freedom. Its error is enlarged by "
        "the root of their "
        "ratio; a parameter of each frame's own, or a model error that differs between frames, may be the cause.",
        shared.chi_square, shared.chi_square_degrees));
  Eigen::MatrixXd stated = Eigen::MatrixXd::Zero(std::ssize(names), std::ssize(names));
  const Eigen::MatrixXd together = moved_together(posteriors, shared);
  for (std::size_t i = 0; i < heard.size(); ++i) {
    if (!heard[i]) continue;
    FitResult& fit = *result.frames[i];
    const Posterior own = own_posterior_of(fit);
    Posterior all = informed(own, shared);
    std::vector<Eigen::Index> of_shared;
    for (const std::string& name : names)
      of_shared.push_back(std::find(all.names.begin(), all.names.end(), name) - all.names.begin());
    const Eigen::MatrixXd in_common =
        in_common_after(own, of_shared, together, posterior_of(fit).covariance - own.covariance);
    all.covariance += in_common;
    stated += in_common(of_shared, of_shared) / static_cast<double>(posteriors.size());
    const double t = interval95_factor(all.degrees_of_freedom);
    move_derived(fit, all, t);
    fit.covariance = all.covariance;
    for (ParameterEstimate& p : fit.parameters) {
      if (!p.limit.empty()) continue;
      const auto at = std::find(all.names.begin(), all.names.end(), p.name) - all.names.begin();
      p.value = all.mean[at];
      p.stderr_ = std::sqrt(all.covariance(at, at));
      p.interval95_low = p.value - t * p.stderr_;
      p.interval95_high = p.value + t * p.stderr_;
    }
  }
  shared.posterior.covariance += stated;
  result.shared = shared;
  return result;
}

std::string series_csv(const ImageSeries& series, const SeriesResult& result) {
  // A frame may lack a parameter that others have: of several branches each takes its own.
  std::vector<std::string> names;
  for (const auto& fit : result.frames)
    if (fit)
      for (const ParameterEstimate& p : fit->parameters)
        if (std::find(names.begin(), names.end(), p.name) == names.end()) names.push_back(p.name);
  const bool pages = std::any_of(series.frames.begin(), series.frames.end(),
                                 [](const SeriesFrame& frame) { return frame.page.has_value(); });
  std::string text = pages ? "file,page" : "file";
  for (const ImageSeries::Column& column : series.columns) text += "," + csv_field(column.name);
  for (const std::string& name : names) text += fmt::format(",{0},{0}_stderr,{0}_low95,{0}_high95", name);
  std::vector<std::string> derived;
  for (const auto& fit : result.frames)
    for (const DerivedEstimate& d : fit ? fit->derived : std::vector<DerivedEstimate>{})
      if (std::find(derived.begin(), derived.end(), d.name) == derived.end()) derived.push_back(d.name);
  for (const std::string& name : derived) text += fmt::format(",{0},{0}_stderr,{0}_low95,{0}_high95", name);
  text += ",reduced_chi_square,verdict,reason\n";
  for (std::size_t i = 0; i < series.frames.size(); ++i) {
    const auto& fit = result.frames[i];
    const SeriesFrame& frame = series.frames[i];
    text += csv_field(frame.file);
    if (pages) text += frame.page ? fmt::format(",{}", *frame.page) : ",";
    for (const SeriesFrame::Cell& given : frame.cells) text += "," + csv_field(given.text);
    for (const std::string& name : names) {
      const ParameterEstimate* estimate = nullptr;
      if (fit)
        for (const ParameterEstimate& p : fit->parameters)
          if (p.name == name) estimate = &p;
      text += "," + (estimate ? cells(*estimate) : ",,,");
    }
    for (const std::string& name : derived) {
      const DerivedEstimate* found = nullptr;
      for (std::size_t k = 0; fit && k < fit->derived.size(); ++k)
        if (fit->derived[k].name == name) found = &fit->derived[k];
      text += found ? fmt::format(",{},{},{},{}", cell(found->value), cell(found->stderr_), cell(found->interval95_low),
                                  cell(found->interval95_high))
                    : ",,,,";
    }
    if (fit)
      text += fmt::format(",{},{},{}\n", cell(fit->reduced_chi_square), fit->grade(),
                          fit->has_answer() ? "" : csv_field(fit->verdict));
    else
      text += frame.unreadable.empty() ? ",,not done,\n" : ",,unreadable," + csv_field(frame.unreadable) + "\n";
  }
  return text;
}

std::string shared_csv(const SeriesResult& result) {
  if (!result.shared) return {};
  const SharedEstimate& shared = *result.shared;
  const double t = interval95_factor(shared.posterior.degrees_of_freedom);
  std::string text = "parameter,value,stderr,low95,high95,frames,chi_square,chi_square_degrees,consistent\n";
  for (std::size_t i = 0; i < shared.posterior.names.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double value = shared.posterior.mean[at], error = std::sqrt(shared.posterior.covariance(at, at));
    text += fmt::format("{},{},{},{},{},{},{},{},{}\n", shared.posterior.names[i], cell(value), cell(error),
                        cell(value - t * error), cell(value + t * error), shared.fits, cell(shared.chi_square),
                        shared.chi_square_degrees, shared.consistent ? "yes" : "no");
  }
  return text;
}

}  // namespace birefit
