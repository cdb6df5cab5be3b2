#include "fit/zone.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "samples/kind.h"
#include "samples/zone.h"

namespace birefit::estimation {
namespace {

/// What the scene's sample takes out of a picture; null: nothing.
std::unique_ptr<Zone> zone_of(const Scene& scene, const Theta& theta) {
  const auto zone = kind_of(scene).zone;
  return zone ? zone(scene, theta) : nullptr;
}

/// A picture of a job with a zone, and where it is among the job's sights.
struct ZonedPicture {
  std::size_t sight = 0;
  Picture* picture = nullptr;
};
std::vector<ZonedPicture> zoned_pictures(FitJob& job) {
  std::vector<ZonedPicture> zoned;
  std::size_t sight = 0;
  for (Measurement& measurement : job.measurements) {
    Picture* picture = std::get_if<Picture>(&measurement);
    if (picture && kind_of(picture->scene).zone) zoned.push_back({sight, picture});
    sight += picture ? 1 : std::get<Readings>(measurement).rows.size();
  }
  return zoned;
}

void leave_out(const Zone& zone, Mask& mask) {
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      if (mask(x, y) && !zone.fitted(x, y)) mask(x, y) = 0;
}

long count(const Mask& mask) {
  return std::count_if(mask.values().begin(), mask.values().end(), [](auto used) { return used != 0; });
}

/// Without whatever the zone covers for some parameters within their bounds.
Mask possible_pixels(const FitJob& job, const Picture& picture, const Theta& theta) {
  std::vector<Theta> places{theta};
  for (const Zone::Mover& mover : zone_of(picture.scene, theta)->movers()) {
    const Parameter& parameter = job.parameters[mover.parameter];
    // Of a tied one, as far as what it follows from may go.
    const auto [low, high] = job.parameters.reach(mover.parameter.index);
    const double width = parameter.free ? parameter.upper - parameter.lower : high - low;
    if (!std::isfinite(width) || !(width > 0)) continue;
    const int steps =
        mover.step > 0
            ? static_cast<int>(std::ceil((mover.period > 0 ? std::min(width, mover.period) : width) / mover.step))
            : 1;
    std::vector<Theta> more;
    for (const Theta& place : places)
      for (int i = 0; i <= steps; ++i) {
        more.push_back(place);
        more.back()[static_cast<std::size_t>(mover.parameter.index)] =
            (parameter.free ? parameter.lower : low) + width * i / std::max(1, steps);
      }
    places = std::move(more);
  }
  Mask mask = picture.mask;
  for (const Theta& place : places) leave_out(*zone_of(picture.scene, place), mask);
  return mask;
}

}  // namespace

Mask fitted_pixels(const Picture& picture, const Theta& theta) {
  Mask mask = picture.mask;
  if (const std::unique_ptr<Zone> zone = zone_of(picture.scene, theta)) leave_out(*zone, mask);
  return mask;
}

FitResult fit_following_zones(const FitJob& job, const std::function<FitResult(const FitJob&)>& fit) {
  FitJob now = job;
  const std::vector<ZonedPicture> zoned = zoned_pictures(now);
  if (zoned.empty()) return fit(job);
  std::vector<Mask> given;
  for (const ZonedPicture& one : zoned) given.push_back(one.picture->mask);
  Theta theta = job.parameters.values();
  bool depends = false;
  for (const ZonedPicture& one : zoned) {
    Mask possible = possible_pixels(job, *one.picture, theta);
    Mask& mask = one.picture->mask;
    mask = fitted_pixels(*one.picture, theta);
    if (possible.values() == mask.values()) continue;
    depends = true;
    // Bounds so wide that they leave next to nothing tell no more than the start.
    constexpr long kEnoughLeft = 4;
    if (kEnoughLeft * count(possible) >= count(mask)) mask = std::move(possible);
  }
  now.options.values_only = depends;  // until it has settled
  FitResult result = fit(now);
  constexpr int kRounds = 8;
  constexpr int kToAndFro = 2;       // rounds after which what was left out stays so
  constexpr double kSettled = 1e-3;  // of the pixels: a zone's edge may pass to and fro over some
  double changed = 1;
  int evaluations = 0;
  double seconds = 0;
  for (int round = 0; depends && round < kRounds && !result.interrupted; ++round) {
    double pixels = 0;
    changed = 0;
    for (std::size_t d = 0; d < zoned.size(); ++d) {
      Picture& picture = *zoned[d].picture;
      Mask before = std::exchange(picture.mask, given[d]);
      picture.mask = fitted_pixels(picture, result.theta);
      if (count(picture.mask) == 0) {  // the sample has left the picture
        picture.mask = std::move(before);
        now.options.values_only = false;
        return fit(now);
      }
      for (std::size_t i = 0; round >= kToAndFro && i < before.size(); ++i)
        if (!before.values()[i]) picture.mask.values()[i] = 0;
      for (std::size_t i = 0; i < before.size(); ++i)
        changed += picture.mask.values()[i] != before.values()[i], pixels += picture.mask.values()[i] != 0;
    }
    changed /= pixels;
    if (changed <= kSettled && !now.options.values_only) break;
    now.options.values_only = now.options.values_only && changed > kSettled && round + 1 < kRounds;
    for (int i = 0; i < now.parameters.size(); ++i) {
      Parameter& p = now.parameters[i];
      // The value of a parameter with a prior is the prior's mean.
      if (p.free && !p.prior_sd) p.value = result.theta[static_cast<std::size_t>(i)];
    }
    evaluations += result.evaluations, seconds += result.seconds;
    result = fit(now);
  }
  result.evaluations += evaluations, result.seconds += seconds;
  for (std::size_t d = 0; d < zoned.size(); ++d)
    result.micrographs[zoned[d].sight].outside = static_cast<int>(count(given[d]) - count(zoned[d].picture->mask));
  for (ParameterEstimate& estimate : result.parameters)
    if (const ParameterRef ref = job.parameters.find(estimate.name)) estimate.start = job.parameters[ref].value;
  if (depends && changed > kSettled && !result.interrupted) {
    result.converged = false;
    result.warnings.push_back(fmt::format(
        "What is left out around the forces and the rim did not settle: {:.2g} % of the pixels changed in the last of "
        "{} fits. Narrower bounds of centre, diameter and load_azimuth_deg hold it.",
        100 * changed, kRounds));
  }
  return result;
}

}  // namespace birefit::estimation
