#include "fit/errors/verdict.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace birefit::estimation {
namespace {

std::string shortened(const std::string& path) {
  const auto dot = path.rfind('.');
  return dot == std::string::npos ? path : path.substr(dot + 1);
}

/// Short names where they are unique among the free parameters, paths otherwise.
std::string name_in(const FitResult& result, int j) {
  const std::string name = shortened(result.parameters[j].name);
  int same = 0;
  for (const ParameterEstimate& estimate : result.parameters) same += shortened(estimate.name) == name;
  return same > 1 ? result.parameters[j].name : name;
}

std::string unit_suffix(const ParameterEstimate& estimate) { return estimate.unit.empty() ? "" : " " + estimate.unit; }

std::string in_words(const std::vector<std::string>& parts, const std::string& last = " and ") {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) text += (i == 0 ? "" : i + 1 == parts.size() ? last : ", ") + parts[i];
  return text;
}

/// "fourier_number up 0.0031 with hot_k down 12.4": a step of `length` along `direction` (parameters' own units).
std::string step_in_words(const FitResult& result, const Eigen::VectorXd& step, const Eigen::VectorXd& scaled) {
  std::vector<std::string> parts;
  const double largest = scaled.cwiseAbs().maxCoeff();
  const double sign = [&] {
    Eigen::Index at;
    scaled.cwiseAbs().maxCoeff(&at);
    return scaled[at] < 0 ? -1.0 : 1.0;
  }();
  for (int j = 0; j < step.size(); ++j)
    if (std::abs(scaled[j]) > 0.1 * largest)
      parts.push_back(fmt::format("{} {} {:.3g}{}", name_in(result, j), sign * step[j] > 0 ? "up" : "down",
                                  std::abs(step[j]), unit_suffix(result.parameters[j])));
  return in_words(parts, " with ");
}

bool in_joint_prior(const FitJob& job, const std::string& name) {
  return job.prior && std::find(job.prior->names.begin(), job.prior->names.end(), name) != job.prior->names.end();
}

/// Each parameter in units of what was asked: its bounds' width, or its own size. Offsets may be zero: theirs is the
/// size of the largest linear parameter, gains that are known included.
Eigen::VectorXd scale_asked(const FitResult& result, const FitJob& job, int n) {
  Eigen::VectorXd scale(n);
  double linear_size = 0;
  for (int j = 0; j < n; ++j)
    if (result.parameters[j].linear) linear_size = std::max(linear_size, std::abs(result.parameters[j].value));
  const Theta theta =
      result.theta.empty() ? job.parameters.values() : result.theta;  // not of a fit, but of its outlook
  for (const Measurement& measurement : job.measurements)
    std::visit(
        [&](const auto& one) {
          if (one.gain) linear_size = std::max(linear_size, std::abs(one.gain.in(theta)));
        },
        measurement);
  for (int j = 0; j < n; ++j) {
    const ParameterEstimate& estimate = result.parameters[j];
    const double width = estimate.upper - estimate.lower;
    scale[j] = estimate.linear ? linear_size : std::isfinite(width) && width > 0 ? width : std::abs(estimate.value);
    if (!(scale[j] > 0)) scale[j] = 1;
  }
  return scale;
}

void not_known(ParameterEstimate& estimate) {
  estimate.stderr_ = estimate.interval95_low = estimate.interval95_high = std::numeric_limits<double>::quiet_NaN();
}

/// The directions in which the data tell most and least, and what they leave unknown.
void judge_directions(FitResult& result, const Eigen::MatrixXd& factor, const Eigen::VectorXd& scale) {
  const int n = static_cast<int>(scale.size());
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(factor * scale.asDiagonal(), Eigen::ComputeFullV);
  // What the data cannot narrow below half the range asked for is not determined by them.
  constexpr double kHalfWidth = 0.5;
  const double nothing = 1e-12 * svd.singularValues()[0];
  for (int i = 0; i < n; ++i) {
    const double sigma = svd.singularValues()[i];
    FisherDirection direction;
    direction.stderr_ = sigma > nothing ? 1 / sigma : std::numeric_limits<double>::infinity();
    const Eigen::VectorXd v = svd.matrixV().col(i);
    for (int j = 0; j < n; ++j) direction.weights.emplace_back(result.parameters[j].name, v[j]);
    direction.identifiable = direction.stderr_ <= kHalfWidth;
    Eigen::Index at;
    v.cwiseAbs().maxCoeff(&at);
    // A limit is an answer, though the estimate itself is not known; so is what the likelihood on both sides says.
    const ParameterEstimate& largest = result.parameters[static_cast<std::size_t>(at)];
    const bool both_sides = largest.profiled && largest.interval95_high - largest.interval95_low < scale[at];
    if (std::abs(v[at]) > 0.999 && (!largest.limit.empty() || both_sides)) direction.identifiable = true;
    if (!(direction.stderr_ <= kHalfWidth) && direction.identifiable && both_sides)
      direction.stderr_ = largest.stderr_ / scale[at];
    if (!direction.identifiable) {
      result.identifiable = false;
      if (std::abs(v[at]) > 0.999)
        direction.words =
            fmt::format("{} has no measurable influence on the image", name_in(result, static_cast<int>(at)));
      else
        direction.words =
            fmt::format("{} changes the image by less than its noise: only other combinations of them are known",
                        step_in_words(result, kHalfWidth * scale.cwiseProduct(v), v));
      for (int j = 0; j < n; ++j)
        if (std::abs(v[j]) * std::min(direction.stderr_, 1e3) > kHalfWidth) not_known(result.parameters[j]);
    }
    result.directions.push_back(std::move(direction));
  }
}

/// Two parameters that only act together: their own errors are those of a long valley, 50 times what each would have
/// with the other known. Formally finite, but a small error of the model slides the estimate along the valley.
void judge_pair(FitResult& result, const FitJob& job, const Unknowns& unknowns, const Inverse& inverse,
                const Eigen::VectorXd& scale, double t, int a, int b) {
  constexpr double kTogether = 0.9999, kValley = 50;
  const ParameterEstimate &pa = result.parameters[a], &pb = result.parameters[b];
  // By the data alone: what models err by moves all parameters together, too, and makes no valley.
  const double of_data_a = std::sqrt(inverse.covariance(a, a)), of_data_b = std::sqrt(inverse.covariance(b, b)),
               correlation = inverse.covariance(a, b) / (of_data_a * of_data_b);
  if (!(std::abs(correlation) > kTogether)) return;
  // Of the camera alone: nobody asks for either, and what slides along with them has valleys of its own.
  if (pa.linear && pb.linear) return;
  const auto is_nuisance = [&](int j) { return job.parameters[unknowns.table_index(j)].nuisance; };
  if (is_nuisance(a) || is_nuisance(b)) return;                              // what it is known to ends the valley
  if (in_joint_prior(job, pa.name) && in_joint_prior(job, pb.name)) return;  // the prior's own correlation
  if (!(of_data_a > kValley * inverse.conditional_sd[a] && of_data_b > kValley * inverse.conditional_sd[b])) return;
  const double sa = std::sqrt(result.covariance(a, a)), sb = std::sqrt(result.covariance(b, b));
  // Of tables each within a few per cent, what models err by and what is stated included, is an answer, however they
  // act together: a film's index and thickness by its interference. (In pictures what is not modelled slides along,
  // too.)
  constexpr double kFew = 0.03;
  const bool tables = std::all_of(job.measurements.begin(), job.measurements.end(),
                                  [](const Measurement& m) { return std::holds_alternative<Readings>(m); });
  if (tables && t * sa < kFew * std::abs(pa.value) && t * sb < kFew * std::abs(pb.value)) return;
  result.identifiable = false;
  FisherDirection direction;
  const double sign = correlation > 0 ? 1 : -1;
  Eigen::Vector2d weights(sa / scale[a], sign * sb / scale[b]);
  direction.stderr_ = weights.norm();
  weights /= direction.stderr_;
  direction.weights = {{pa.name, weights[0]}, {pb.name, weights[1]}};
  direction.identifiable = false;
  // No end of an interval lies where the number cannot be.
  const auto end = [](const ParameterEstimate& p, double at) {
    return std::isfinite(p.upper - p.lower) ? std::clamp(at, p.lower, p.upper) : at;
  };
  const double across = t * sa * std::sqrt(std::max(0.0, 1 - correlation * correlation));
  direction.words = fmt::format(
      "{0} up {1:.3g}{2} with {3} {4} {5:.3g}{6} leaves the image nearly unchanged: only this combination of the "
      "two is determined. Along it the 95 % interval is {0} {7:.5g} to {8:.5g}{2} (with {3} {9:.5g} to {10:.5g}{6}); "
      "across it, with {3} known, {0} would be known to +-{11:.2g}{2}",
      name_in(result, a), t * sa, unit_suffix(pa), name_in(result, b), sign > 0 ? "up" : "down", t * sb,
      unit_suffix(pb), end(pa, pa.value - t * sa), end(pa, pa.value + t * sa), end(pb, pb.value - sign * t * sb),
      end(pb, pb.value + sign * t * sb), across);
  result.directions.push_back(std::move(direction));
}

}  // namespace

std::string with_error(double value, double error) {
  if (!std::isfinite(error) || !(error > 0)) return fmt::format("{:.6g}", value);
  const int digits = std::clamp(1 - static_cast<int>(std::floor(std::log10(error))), 0, 12);
  return fmt::format("{:.{}f} +- {:.2g}", value, digits, error);
}

void judge_identifiability(FitResult& result, const FitJob& job, const Unknowns& unknowns,
                           const Eigen::MatrixXd& factor, const Inverse& inverse) {
  const int n = unknowns.size();
  if (n == 0) return;
  const Eigen::VectorXd scale = scale_asked(result, job, n);
  judge_directions(result, factor, scale);
  for (int j = 0; j < n; ++j)
    if (inverse.undetermined[j] && result.parameters[j].limit.empty() && !result.parameters[j].profiled) {
      result.identifiable = false;
      not_known(result.parameters[j]);
    }
  const double t = student_t_quantile(0.975, result.interval_degrees_of_freedom);
  for (int a = 0; a < n; ++a)
    for (int b = a + 1; b < n; ++b) judge_pair(result, job, unknowns, inverse, scale, t, a, b);
}

namespace {

using Sentences = std::vector<std::string>;

/// How the fit ended, and what the data do not tell.
void say_state(const FitResult& result, bool signal, bool rows, Sentences& sentences) {
  if (result.interrupted)
    sentences.push_back("The fit was interrupted: these are the best values so far, not a result.");
  else if (!result.converged)
    sentences.push_back("The fit did not converge: the values below are no result.");
  if (!signal)
    sentences.push_back(
        rows
            ? "The table shows no signal of the model: a constant explains it as well, so that the values mean nothing."
            : "The image shows no signal of the model: a constant image explains it as well, so that the values mean "
              "nothing.");
  else if (!result.described && result.left_over > kMostLeftOver)
    sentences.push_back(
        fmt::format("The model is not that of the {}: it leaves {:.0f} % of what there is to see unexplained, so that "
                    "the values mean little.",
                    rows ? "table" : "image", 100 * result.left_over));
  for (const FisherDirection& direction : result.directions)
    if (!direction.identifiable && !direction.words.empty())
      sentences.push_back("Not identifiable: " + direction.words + ".");
  if (result.ambiguous) {
    std::vector<std::string> others;
    for (const RivalMinimum& rival : result.rivals)
      if (rival.counts)
        others.push_back(std::abs(std::log(rival.odds / rival.likelihood_ratio)) < 0.7
                             ? fmt::format("odds {:.2g}", rival.odds)
                             : fmt::format("odds {:.2g}, likelihood ratio {:.2g}", rival.odds, rival.likelihood_ratio));
    sentences.push_back(fmt::format("Ambiguous: {} other minim{} of the misfit cannot be excluded ({}).", others.size(),
                                    others.size() == 1 ? "um" : "a", in_words(others)));
  }
}

void say_bounds(const FitResult& result, Sentences& sentences) {
  for (const DerivedEstimate& d : result.derived)
    if (d.held)
      sentences.push_back(fmt::format(
          "{} = {} is {:.6g} at the best values, which it cannot be: it was held at {:.6g}{}, and narrower bounds of "
          "what it follows from are needed.",
          d.name, d.expression, d.expected, d.value, d.unit.empty() ? "" : " " + d.unit));
  for (const ParameterEstimate& estimate : result.parameters) {
    if (!estimate.at_bound && estimate.limit.empty()) continue;
    const std::string name = shortened(estimate.name), unit = unit_suffix(estimate);
    const bool upper = estimate.limit == "upper";
    // What the unit of a reduced voltage means.
    const std::string below =
        name == "reduced_voltage" && upper && estimate.limit_value < 1 ? "Below the threshold: " : "";
    if (estimate.limit.empty())
      sentences.push_back(fmt::format("{} ended at its bound {:.6g}{}: the best value lies outside the bounds.", name,
                                      estimate.value, unit));
    else if (estimate.at_bound)
      sentences.push_back(fmt::format("{}{} is at its physical limit {:.6g}{}: {} {:.4g}{} with 95 % confidence.",
                                      below, name, estimate.value, unit, upper ? "at most" : "at least",
                                      estimate.limit_value, unit));
    else
      sentences.push_back(
          fmt::format("{}{} is at most {:.4g}{} with 95 % confidence: the data do not tell it from {:.6g}{}.", below,
                      name, estimate.limit_value, unit, estimate.lower, unit));
  }
}

/// True where one is: its sentence comes before the values.
bool say_contradictions(const FitResult& result, Sentences& sentences) {
  bool contradicted = false;
  for (int j = 0; j < static_cast<int>(result.parameters.size()); ++j) {
    const ParameterEstimate& p = result.parameters[j];
    if (!p.prior_value || !p.prior_sd || !std::isfinite(p.stderr_)) continue;
    // Of the estimate less the prior's mean, the variance that both expect; where the data add little, not less than a
    // tenth of the prior's.
    const double expected = std::sqrt(
                     std::max(*p.prior_sd * *p.prior_sd - p.stderr_ * p.stderr_, 0.1 * *p.prior_sd * *p.prior_sd)),
                 away = std::abs(p.value - *p.prior_value) / expected;
    if (!(away > 4)) continue;
    contradicted = true;
    sentences.push_back(
        fmt::format("{} contradicts what was known of it: {} instead of {}{}, {:.0f} standard deviations away. One of "
                    "the two is wrong.",
                    name_in(result, j), with_error(p.value, p.stderr_), with_error(*p.prior_value, *p.prior_sd),
                    unit_suffix(p), away));
  }
  return contradicted;
}

void say_values(const FitResult& result, bool signal, Sentences& sentences) {
  std::vector<std::string> values;
  if (signal)
    for (int j = 0; j < static_cast<int>(result.parameters.size()); ++j) {
      const ParameterEstimate& estimate = result.parameters[j];
      if (estimate.linear || !std::isfinite(estimate.stderr_) || estimate.at_bound || !estimate.limit.empty()) continue;
      values.push_back(fmt::format("{} = {}{}", name_in(result, j), with_error(estimate.value, estimate.stderr_),
                                   unit_suffix(estimate)));
    }
  if (!values.empty()) sentences.push_back(in_words(values) + " (standard errors: " + result.covariance_kind + ").");
  for (int j = 0; j < static_cast<int>(result.parameters.size()); ++j) {
    const ParameterEstimate& p = result.parameters[j];
    if (signal && p.profiled && std::isfinite(p.stderr_))
      sentences.push_back(fmt::format("The 95 % interval of {} is {:.4g} to {:.4g}{}, by its profile likelihood.",
                                      name_in(result, j), p.interval95_low, p.interval95_high, unit_suffix(p)));
  }
}

/// Why an answer is one with misfit.
void say_misfit(const FitResult& result, Sentences& sentences) {
  if (!result.misfit.empty()) sentences.push_back("With misfit: " + in_words(result.misfit, "; and ") + ".");
}

/// The inputs whose error would be the estimates', those that are taken as exact or those that are not.
void say_inputs(const FitResult& result, bool signal, bool exact, Sentences& sentences) {
  std::vector<std::string> inputs;
  for (const InputEffect& input : result.inputs) {
    if ((input.known_to == 0) != exact) continue;
    int most = -1;
    double weight = 0.5;  // standard errors
    for (int j = 0; j < static_cast<int>(result.parameters.size()); ++j) {
      const ParameterEstimate& p = result.parameters[j];
      const double here = p.stderr_ > 0 ? std::abs(input.shift[static_cast<std::size_t>(j)]) / p.stderr_ : 0;
      if (!p.linear && p.unit != "px" && here > weight) most = j, weight = here;
    }
    if (most < 0 || inputs.size() == 3) continue;
    const ParameterEstimate& p = result.parameters[most];
    const double shift = input.shift[static_cast<std::size_t>(most)];
    const bool of_value = p.unit != "deg" && std::abs(p.value) > 10 * p.stderr_;  // what may be zero has no per cent
    inputs.push_back(
        fmt::format("{} more of {} makes {} {}", input.unit == "deg" || input.unit == "px" ? "1 " + input.unit : "1 %",
                    input.name, name_in(result, most),
                    of_value ? fmt::format("{:+.2g} %", 100 * shift / std::abs(p.value))
                             : fmt::format("{:+.2g}{}", shift, unit_suffix(p))) +
        (exact ? ""
               : fmt::format(" (known to {:.2g}{}{})", input.known_to, input.unit.empty() ? "" : " ", input.unit)));
  }
  if (signal && !inputs.empty())
    sentences.push_back((exact ? "Taken as exact: " : "In the errors, as well as it is known: ") + in_words(inputs) +
                        ".");
}

}  // namespace

std::string verdict(const FitResult& result, bool signal) {
  const bool rows = std::all_of(result.micrographs.begin(), result.micrographs.end(),
                                [](const MicrographResult& m) { return m.used == 1; });
  Sentences sentences;
  say_state(result, signal, rows, sentences);
  say_bounds(result, sentences);
  const bool contradicted = say_contradictions(result, sentences);
  say_values(result, signal, sentences);
  if (result.has_answer())
    sentences.push_back(fmt::format(
        "Reduced chi-square {:.3g}{}.", result.reduced_chi_square,
        result.reduced_chi_square > 2 && contradicted ? ", that contradiction included"
        : result.reduced_chi_square > 2
            ? std::string(": the model does not describe the ") + (rows ? "signal" : "image") + " within its noise"
            : ""));
  say_misfit(result, sentences);
  say_inputs(result, signal, false, sentences);
  say_inputs(result, signal, true, sentences);
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : " ") + sentence;
  return text;
}

}  // namespace birefit::estimation
