#include "study/interference_chart.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/threads.h"
#include "fit/errors/statistics.h"
#include "instrument/channel_light.h"
#include "medium/indices.h"
#include "medium/validity.h"

namespace birefit {
namespace {

constexpr double kSodiumUm = 0.5893;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// n_e - n_o against that at 589.3 nm; 1 of a sample that has no indices of its own.
std::vector<double> dispersion_of(const Scene& scene, const Theta& theta, const std::vector<double>& wavelength_um) {
  std::vector<double> d(wavelength_um.size(), 1.0);
  const auto* constant = std::get_if<ConstantIndices>(&scene.material);
  if (constant && !constant->birefringence) return d;
  const Values<double> value(theta, {});
  const auto known = wavelengths_um(scene.material, std::nullopt);
  const auto at = [&](double um) {
    // A law ends where its source does; what a camera sees beyond is next to nothing.
    if (known) um = std::clamp(um, known->lower, known->upper);
    const Indices<double> n = material_indices<double>(scene.material, value, um);
    return n.extraordinary - n.ordinary;
  };
  const double sodium = at(kSodiumUm);
  for (std::size_t k = 0; k < d.size() && sodium != 0; ++k) d[k] = at(wavelength_um[k]) / sodium;
  return d;
}

ColourCurve curve_of(const Scene& scene, const Theta& theta, const Channels& channels, double up_to_um) {
  const SpectralSum fine = channels.fine(up_to_um);
  std::vector<double> t = dispersion_of(scene, theta, fine.wavelength_um);
  std::vector<FringeOfLine> fringe;
  for (std::size_t k = 0; k < fine.size(); ++k) {
    t[k] /= fine.wavelength_um[k];
    const Theta here = at_wavelength(scene.microscope, theta, fine.wavelength_um[k]);
    fringe.push_back(diagonal_fringe(scene.microscope, Values<double>(here, {})));
  }
  return {fine, fringe, t, up_to_um};
}

Channels channels_of_all(const std::vector<Scene>& scenes, const Theta& theta) {
  std::vector<Spectrum> sensitivities;
  for (const Scene& scene : scenes) {
    const auto& table = scene.microscope.channel_light->sensitivity;
    sensitivities.push_back(table ? Spectrum(*table) : Spectrum(EqualEnergy{}));
  }
  return channels_of(*scenes.front().microscope.channel_light, theta, std::move(sensitivities));
}

}  // namespace

ColourCurve camera_curve(const std::vector<Scene>& scenes, const Theta& theta, double up_to_um) {
  return curve_of(scenes.front(), theta, channels_of_all(scenes, theta), up_to_um);
}

std::vector<ChartColour> interference_chart(const std::vector<Scene>& scenes, const Theta& theta, double up_to_um,
                                            double step_um) {
  const Scene& scene = scenes.front();
  const Channels observer =
      channels_of(*scene.microscope.channel_light, theta, {colour_matching(0), colour_matching(1), colour_matching(2)});
  const ColourCurve eye = curve_of(scene, theta, observer, up_to_um), camera = camera_curve(scenes, theta, up_to_um);
  const std::vector<double>& w = observer.white();
  const Xyz white{w[0] / w[1], 1, w[2] / w[1]};
  std::vector<ChartColour> chart(static_cast<std::size_t>(std::lround(up_to_um / step_um)) + 1);
  for (std::size_t i = 0; i < chart.size(); ++i) {
    ChartColour& one = chart[i];
    one.retardance_um = std::min(step_um * static_cast<double>(i), up_to_um);
    for (std::size_t c = 0; c < camera.channels(); ++c) one.channels.push_back(camera.at(c, one.retardance_um));
    const Xyz colour = interference_colour(eye, one.retardance_um, white);
    one.eye = lab_of(colour, white);
    const Rgb light = linear_srgb(colour, white);
    one.screen = {srgb_code(light.r), srgb_code(light.g), srgb_code(light.b)};
  }
  for (ChartColour& one : chart) {
    one.distance = std::numeric_limits<double>::infinity();
    for (const ChartColour& other : chart) {
      if (std::abs(other.retardance_um - one.retardance_um) <= kApartUm) continue;
      const double distance = ciede2000(one.eye, other.eye);
      if (distance < one.distance) one.distance = distance, one.double_um = other.retardance_um;
    }
  }
  return chart;
}

RetardanceMap retardance_map(const ColourCurve& curve, const std::vector<Image>& channels, const Mask& mask,
                             double noise, int threads) {
  const int w = channels.front().width(), h = channels.front().height();
  RetardanceMap map{Image(w, h, kNaN), Image(w, h, kNaN), Image(w, h, kNaN), Image(w, h, 0), Image(w, h, kNaN)};
  const double free = static_cast<double>(channels.size()) - 1;  // one channel has a retardance for whatever it shows
  const double most = free > 0 ? estimation::chi_square_quantile(0.999, free) : std::numeric_limits<double>::infinity();
  const std::vector<double> noises(channels.size(), noise);
  parallel_for(h, threads, [&](int row) {
    std::vector<double> recorded(channels.size());
    for (int column = 0; column < w; ++column) {
      if (!mask(column, row)) continue;
      for (std::size_t c = 0; c < channels.size(); ++c) recorded[c] = channels[c](column, row);
      std::vector<RetardanceOfColour> found = retardances_of(curve, recorded, noises);
      if (found.empty()) continue;
      map.chi_square(column, row) = found[0].chi_square;
      if (found[0].chi_square > most)
        found = retardances_of(curve, recorded,
                               std::vector<double>(channels.size(), noise * std::sqrt(found[0].chi_square / free)));
      map.retardance_um(column, row) = found[0].g_um, map.error_um(column, row) = found[0].error_um;
      if (found.size() > 1) map.rival_um(column, row) = found[1].g_um, map.rival_odds(column, row) = found[1].odds;
    }
  });
  constexpr double kUnlikely = 0.05;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (!mask.values()[i]) continue;
    ++map.used;
    map.settled += map.rival_odds.values()[i] < kUnlikely;
    map.unlike += map.chi_square.values()[i] > most;
  }
  return map;
}

}  // namespace birefit
