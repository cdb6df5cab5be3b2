#include "fit/zone.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "samples/disc/disc.h"

namespace birefit::estimation {
namespace {

const StressedDisc* disc_of(const Picture& picture) { return std::get_if<StressedDisc>(&picture.scene.sample); }

/// The pictures of discs among a job's measurements, and where they are among its sights.
struct PictureOfDisc {
  std::size_t sight = 0;
  Picture* picture = nullptr;
};
std::vector<PictureOfDisc> discs_of(FitJob& job) {
  std::vector<PictureOfDisc> discs;
  std::size_t sight = 0;
  for (Measurement& measurement : job.measurements) {
    Picture* picture = std::get_if<Picture>(&measurement);
    if (picture && disc_of(*picture)) discs.push_back({sight, picture});
    sight += picture ? 1 : std::get<Readings>(measurement).rows.size();
  }
  return discs;
}

Mask outside_all(Mask mask, const std::vector<DiscZone>& zones) {
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      if (mask(x, y) && !std::all_of(zones.begin(), zones.end(), [&](const DiscZone& z) { return z.fitted(x, y); }))
        mask(x, y) = 0;
  return mask;
}

long count(const Mask& mask) {
  return std::count_if(mask.values().begin(), mask.values().end(), [](auto used) { return used != 0; });
}

/// Without whatever the zone covers for some parameters within their bounds: the corners of centre, diameter and pixel
/// size, the forces at steps of half of what is left out around them.
Mask possible_pixels(const FitJob& job, const Picture& micrograph, const Theta& theta) {
  const StressedDisc& disc = *disc_of(micrograph);
  const View& view = micrograph.scene.view;
  std::vector<Theta> places{theta};
  for (const ParameterRef ref : {disc.diameter_um, view.pixel_size_um, view.center_x_px, view.center_y_px,
                                 disc.load_azimuth_deg, view.rotation_deg}) {
    if (!ref || !job.parameters[ref].free) continue;
    const double lower = job.parameters[ref].lower, upper = job.parameters[ref].upper;
    if (!std::isfinite(upper - lower)) continue;
    int steps = 1;
    if (ref == disc.load_azimuth_deg || ref == view.rotation_deg) {
      const double contact = DiscZone(micrograph.scene, theta).margins().contact * 180 / std::numbers::pi;
      steps = static_cast<int>(std::ceil(std::min(upper - lower, 180.0) / (0.5 * contact)));
    }
    std::vector<Theta> more;
    for (const Theta& place : places)
      for (int i = 0; i <= steps; ++i) {
        more.push_back(place);
        more.back()[static_cast<std::size_t>(ref.index)] = lower + (upper - lower) * i / std::max(1, steps);
      }
    places = std::move(more);
  }
  std::vector<DiscZone> zones;
  for (const Theta& place : places) zones.emplace_back(micrograph.scene, place);
  return outside_all(micrograph.mask, zones);
}

}  // namespace

Mask fitted_pixels(const Picture& micrograph, const Theta& theta) {
  return disc_of(micrograph) ? outside_all(micrograph.mask, {DiscZone(micrograph.scene, theta)}) : micrograph.mask;
}

FitResult fit_following_zones(const FitJob& job, const std::function<FitResult(const FitJob&)>& fit) {
  FitJob now = job;
  const std::vector<PictureOfDisc> discs = discs_of(now);
  if (discs.empty()) return fit(job);
  std::vector<Mask> given;
  for (const PictureOfDisc& disc : discs) given.push_back(disc.picture->mask);
  Theta theta = job.parameters.values();
  bool depends = false;
  for (const PictureOfDisc& disc : discs) {
    Mask possible = possible_pixels(job, *disc.picture, theta);
    Mask& mask = disc.picture->mask;
    mask = fitted_pixels(*disc.picture, theta);
    if (possible.values() == mask.values()) continue;
    depends = true;
    // Bounds so wide that they leave next to nothing tell no more than the start.
    constexpr long kEnoughLeft = 4;
    if (kEnoughLeft * count(possible) >= count(mask)) mask = std::move(possible);
  }
  FitResult result = fit(now);
  constexpr int kRounds = 6;
  constexpr double kSettled = 1e-3;  // of the pixels: a zone's edge may pass to and fro over some
  double changed = 1;
  int evaluations = 0;
  double seconds = 0;
  for (int round = 0; depends && round < kRounds && changed > kSettled && !result.interrupted; ++round) {
    double pixels = 0;
    changed = 0;
    for (std::size_t d = 0; d < discs.size(); ++d) {
      Picture& picture = *discs[d].picture;
      const Mask before = std::exchange(picture.mask, given[d]);
      picture.mask = fitted_pixels(picture, result.theta);
      if (count(picture.mask) == 0) return result;  // the disc has left the picture
      for (std::size_t i = 0; i < before.size(); ++i)
        changed += picture.mask.values()[i] != before.values()[i], pixels += picture.mask.values()[i] != 0;
    }
    changed /= pixels;
    if (changed == 0) break;
    for (int i = 0; i < now.parameters.size(); ++i) {
      Parameter& p = now.parameters[i];
      // The value of a parameter with a prior is the prior's mean.
      if (p.free && !p.prior_sd) p.value = result.theta[static_cast<std::size_t>(i)];
    }
    evaluations += result.evaluations, seconds += result.seconds;
    result = fit(now);
  }
  result.evaluations += evaluations, result.seconds += seconds;
  for (std::size_t d = 0; d < discs.size(); ++d)
    result.micrographs[discs[d].sight].outside = static_cast<int>(count(given[d]) - count(discs[d].picture->mask));
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
