#include "fit/errors/catalogue.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "fit/errors/discrepancy.h"
#include "fit/problem/effects.h"

namespace birefit::estimation {
namespace {

const std::string kPrefix = "departure.";

/// Beside a picture's gain: what it is called, the unit, and the standard deviation that it has among pictures.
struct Kind {
  const char* name;
  const char* unit;
  double sd;
};
constexpr Kind kBlur{"blur", "px^2", 0.15};
constexpr Kind kGamma{"gamma", "", 0.03};
constexpr Kind kCurve{"curve", "", 0.03};
constexpr Kind kStretchX{"stretch_x", "", 0.003};
constexpr Kind kStretchDiagonal{"stretch_diagonal", "", 0.003};
struct Uneven {
  Kind kind;
  UnevenLight::Shape shape;
  bool of_intensity;
};
constexpr Uneven kUneven[] = {{{"light_x", "", 0.02}, UnevenLight::Shape::x, true},
                              {{"light_y", "", 0.02}, UnevenLight::Shape::y, true},
                              {{"light_square", "", 0.02}, UnevenLight::Shape::square, true},
                              {{"background_x", "", 0.01}, UnevenLight::Shape::x, false},
                              {{"background_y", "", 0.01}, UnevenLight::Shape::y, false},
                              {{"background_square", "", 0.01}, UnevenLight::Shape::square, false}};

}  // namespace

bool asks_catalogue(const Task& task, const Optimum& optimum) {
  // What misses more of the contrast is not nearly the picture's model: other physics, another director.
  constexpr double kNearly = 0.02;
  if (optimum.stopped || task.frames() != 1 || !task.picture(0).effects.empty()) return false;
  const LeastSquares& problem = *optimum.problem;
  const Eigen::ArrayXd sigma = problem.pixels(0).sigma.array(),
                       residual = problem.noise_whitened_residual(0).array() * sigma;
  const auto [low, high] = problem.intensity_range(0);
  const double contrast = std::abs(task.gain_of(0, optimum.theta)) * (high - low),
               missed = std::sqrt(std::max(0.0, (residual.square() - sigma.square()).mean()));
  return missed < kNearly * contrast && leaves_discrepancy(task, optimum);
}

FitJob with_catalogue(const Task& task, const Optimum& optimum) {
  FitJob wider = with_nuisances(task.job, told_numbers(task, optimum));
  const double gain = std::abs(task.gain_of(0, optimum.theta));
  const auto term = [&](const Kind& kind) {
    Parameter parameter;
    parameter.name = kPrefix + kind.name;
    parameter.unit = kind.unit;
    parameter.free = parameter.nuisance = parameter.linear = true;
    parameter.prior_sd = kind.sd * gain;
    return wider.parameters.add(std::move(parameter));
  };
  Picture& picture = std::get<Picture>(wider.measurements.front());
  for (const Uneven& one : kUneven) {
    const bool fitted = std::any_of(picture.uneven.begin(), picture.uneven.end(), [&](const UnevenLight& own) {
      return own.shape == one.shape && own.of_intensity == one.of_intensity;
    });
    if (!fitted) picture.uneven.push_back({term(one.kind), one.shape, one.of_intensity, true});
  }
  using Effect = PictureEffect::Kind;
  for (const auto& [kind, effect] : {std::pair(kBlur, Effect::blur),
                                     {kGamma, Effect::gamma},
                                     {kCurve, Effect::curve},
                                     {kStretchX, Effect::stretch_x},
                                     {kStretchDiagonal, Effect::stretch_diagonal}})
    picture.effects.push_back({term(kind), effect});
  return wider;
}

Eigen::VectorXd shift_by_aspect(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance) {
  const Picture& picture = task.picture(0);
  const double gain = std::abs(task.gain_of(0, optimum.theta));
  double stretch = 0;
  for (const PictureEffect& effect : picture.effects)
    if (effect.kind == PictureEffect::Kind::stretch_x || effect.kind == PictureEffect::Kind::stretch_diagonal)
      stretch = std::hypot(stretch, optimum.theta[static_cast<std::size_t>(effect.coefficient.index)] / gain);
  if (!(gain > 0) || !(stretch > 0)) return {};
  const PixelSet& set = optimum.problem->pixels(0);
  const View& view = picture.scene.view;
  KnownLight known(view.width, view.height);
  known.center_x = view.center_x_px.in(optimum.theta), known.center_y = view.center_y_px.in(optimum.theta);
  const Eigen::VectorXd& light = optimum.problem->intensity();
  for (std::size_t i = 0; i < set.pixels.size(); ++i)
    known.set(set.pixels[i][0], set.pixels[i][1], light[static_cast<Eigen::Index>(i)]);
  Eigen::VectorXd change(light.size());
  for (std::size_t i = 0; i < set.pixels.size(); ++i)
    change[static_cast<Eigen::Index>(i)] =
        stretch * effect_at(PictureEffect::Kind::growth, known, set.pixels[i][0], set.pixels[i][1]);
  return optimum.problem->shift_by(change, covariance);
}

std::vector<Departure> departures_of(const Task& task, const FitResult& result) {
  std::vector<Departure> departures;
  const double gain = std::abs(task.gain_of(0, result.theta));
  for (const ParameterEstimate& estimate : result.parameters)
    if (estimate.name.starts_with(kPrefix) && estimate.prior_sd && gain > 0)
      departures.push_back({estimate.name.substr(kPrefix.size()), estimate.unit, estimate.value / gain,
                            estimate.stderr_ / gain, *estimate.prior_sd / gain});
  return departures;
}

}  // namespace birefit::estimation
