#pragma once
// The one loop over directions, and the one over wavelengths: a picture is a sum of pictures in light of one direction
// and one wavelength.

#include <algorithm>
#include <vector>

#include "birefit/render.h"
#include "instrument/channel_light.h"
#include "instrument/exposure.h"

namespace birefit {

/// sum = kept * sum + share * part.
inline void mix(Image& sum, double kept, const Image& part, double share) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum.values()[i] = kept * sum.values()[i] + share * part.values()[i];
}
inline void mix(Rendering& sum, double kept, const Rendering& part, double share) {
  mix(sum.intensity, kept, part.intensity, share);
  for (std::size_t j = 0; j < sum.derivatives.size(); ++j) mix(sum.derivatives[j], kept, part.derivatives[j], share);
}
inline void mix(PixelRendering& sum, double kept, const PixelRendering& part, double share) {
  sum.intensity = kept * sum.intensity + share * part.intensity;
  sum.derivatives = kept * sum.derivatives + share * part.derivatives;
}

/// of_one(light, result) for each direction, and their sum by weight. Of a single one `into` holds what it brings, bit
/// for bit.
template <class Result, class OfOne>
void sum_over_directions(const Exposure& exposure, Result& into, const OfOne& of_one) {
  of_one(exposure.directions.front(), into);
  for (std::size_t k = 1; k < exposure.directions.size(); ++k) {
    Result part;
    of_one(exposure.directions[k], part);
    mix(into, k == 1 ? exposure.weights.front() : 1.0, part, exposure.weights[k]);
  }
}

/// All zero, as large as `like`, with so many derivatives.
inline void start_sum(const Rendering& like, std::size_t derivatives, Rendering& sum) {
  const Image zero(like.intensity.width(), like.intensity.height(), 0);
  sum.intensity = zero;
  sum.derivatives.assign(derivatives, zero);
}
inline void start_sum(const PixelRendering& like, std::size_t derivatives, PixelRendering& sum) {
  sum.intensity = Eigen::VectorXd::Zero(like.intensity.size());
  sum.derivatives = Eigen::MatrixXd::Zero(like.intensity.size(), static_cast<Eigen::Index>(derivatives));
}
inline void add(Image& sum, double share, const Image& part) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum.values()[i] += share * part.values()[i];
}
/// sum's intensity += share * part's; its derivative j += share * part's derivative i, or share * part's intensity.
inline void add_intensity(Rendering& sum, double share, const Rendering& part) {
  add(sum.intensity, share, part.intensity);
}
inline void add_derivative(Rendering& sum, std::size_t j, double share, const Rendering& part, std::size_t i) {
  add(sum.derivatives[j], share, part.derivatives[i]);
}
inline void add_slope(Rendering& sum, std::size_t j, double share, const Rendering& part) {
  add(sum.derivatives[j], share, part.intensity);
}
inline void add_intensity(PixelRendering& sum, double share, const PixelRendering& part) {
  sum.intensity += share * part.intensity;
}
inline void add_derivative(PixelRendering& sum, std::size_t j, double share, const PixelRendering& part,
                           std::size_t i) {
  sum.derivatives.col(static_cast<Eigen::Index>(j)) += share * part.derivatives.col(static_cast<Eigen::Index>(i));
}
inline void add_slope(PixelRendering& sum, std::size_t j, double share, const PixelRendering& part) {
  sum.derivatives.col(static_cast<Eigen::Index>(j)) += share * part.intensity;
}

/// of_one(light, active, result) for the condenser's directions, and their sum with its derivatives by the condenser.
/// `waves` as of condenser_disc().
template <class Result, class OfOne>
void sum_over_condenser(const Microscope& microscope, const Theta& theta, int rings, const std::vector<int>& active,
                        bool waves, Result& into, const OfOne& of_one) {
  const Exposure exposure = condenser_exposure(microscope, Values<double>(theta, {}, nullptr), rings, waves);
  std::vector<int> of_scene;
  std::vector<std::size_t> place;  // of which `active` they are
  for (std::size_t j = 0; j < active.size(); ++j)
    if (moves_condenser(microscope, active[j], waves) != MovesCondenser::alone) {
      of_scene.push_back(active[j]);
      place.push_back(j);
    }
  Result mean;
  sum_over_directions(exposure, mean, [&](const BeamMaker& light, Result& one) { of_one(light, of_scene, one); });
  start_sum(mean, active.size(), into);
  add_intensity(into, 1, mean);
  for (std::size_t i = 0; i < place.size(); ++i) add_derivative(into, place[i], 1, mean, i);
  for (std::size_t j = 0; j < active.size(); ++j) {
    if (moves_condenser(microscope, active[j], waves) == MovesCondenser::no) continue;
    const CondenserSlope slope = condenser_slope(microscope, theta, rings, active[j], waves);
    add_slope(into, j, slope.of_mean, mean);
    Result part;
    for (std::size_t k = 0; k < slope.on_circles.directions.size(); ++k) {
      of_one(slope.on_circles.directions[k], {}, part);
      add_slope(into, j, slope.on_circles.weights[k], part);
    }
  }
}

/// of_one(plan, theta, active, rule, result) for every wavelength of the plan, and their sum by weight; of a line once,
/// bit for bit. The light's own numbers move the weights and no picture. `by_sample`: once, with the rule that the
/// sample sums by; else `rule` is null.
template <class Result, class OfOne>
void sum_over_wavelengths(const Microscope& microscope, const RenderPlan& plan, const Theta& theta,
                          const std::vector<int>& active, bool by_sample, Result& into, const OfOne& of_one) {
  const WavelengthRule* const none = nullptr;
  if (!plan.wavelengths) return of_one(plan, theta, active, none, into);
  const auto rule = rule_at(plan.wavelengths, microscope, theta);
  if (by_sample) return of_one(plan, theta, active, rule.get(), into);
  std::vector<int> of_scene;
  std::vector<std::size_t> place;  // of which `active` they are
  for (std::size_t j = 0; j < active.size(); ++j) {
    const bool of_light = active[j] == microscope.wavelength_nm.index ||
                          std::find(rule->index.begin(), rule->index.end(), active[j]) != rule->index.end();
    if (of_light) continue;
    of_scene.push_back(active[j]);
    place.push_back(j);
  }
  Result part;
  for (std::size_t k = 0; k < rule->size(); ++k) {
    const RenderPlan& of_line = plan.of_wavelengths.empty() ? plan : plan.of_wavelengths.at(k);
    of_one(of_line, at_wavelength(microscope, theta, 1e-3 * rule->wavelength_nm[k]), of_scene, none, part);
    if (k == 0) start_sum(part, active.size(), into);
    add_intensity(into, rule->weight[k], part);
    for (std::size_t i = 0; i < place.size(); ++i) add_derivative(into, place[i], rule->weight[k], part, i);
    for (std::size_t n = 0; n < rule->index.size(); ++n)
      for (std::size_t j = 0; j < active.size(); ++j)
        if (active[j] == rule->index[n]) add_slope(into, j, rule->slope[n][k], part);
  }
}

/// Which of the two sums a sample's picture is in itself.
struct SumsOfSample {
  bool wavelengths, directions;
};

/// of_one(plan, theta, light, active, result) for every wavelength and direction, and their sum with its derivatives.
/// exposure: the directions; null: the microscope's own, as planned.
template <class Result, class OfOne>
void sum_over_light(const Microscope& microscope, const RenderPlan& plan, const Exposure* exposure,
                    const SumsOfSample& by_sample, const Theta& theta, const std::vector<int>& active, Result& into,
                    const OfOne& of_one) {
  const bool condenser = !exposure && plan.condenser_rings > 0 && !by_sample.directions;
  const auto of_line = [&](const RenderPlan& own, const Theta& at, const std::vector<int>& of_scene,
                           const WavelengthRule* rule, Result& line) {
    const auto of_direction = [&](const BeamMaker& light, const std::vector<int>& by, Result& one) {
      of_one(own, at, light.with(rule), by, one);
    };
    if (condenser)
      sum_over_condenser(microscope, at, plan.condenser_rings, of_scene, static_cast<bool>(plan.wave), line,
                         of_direction);
    else
      sum_over_directions(exposure ? *exposure : exposure_of(microscope), line,
                          [&](const BeamMaker& light, Result& one) { of_direction(light, of_scene, one); });
  };
  sum_over_wavelengths(microscope, plan, theta, active, by_sample.wavelengths, into, of_line);
}

}  // namespace birefit
