#pragma once
// Random problems of plane cells: every image is one number, so that only many of them tell the order.

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "independent_cell.h"
#include "random_problems.h"

namespace birefit::testing {

/// A planar cell at five wavelengths and two analyser angles.
inline void cell(RandomProblem& p) {
  Scene s = seen(p, 24, 1);
  Cell sample;
  sample.thickness_um = p.b.fixed("thickness_um", 20);
  UniformDirector director;
  director.azimuth_deg = p.anywhere("azimuth_deg", 5, 40);
  director.tilt_deg = p.b.fixed("tilt_deg", 0);
  sample.director = director;
  s.sample = sample;
  s.material = ConstantIndices{p.b.fixed("ordinary", 1.52), p.anywhere("birefringence", 0.04, 0.25)};
  s.surround_index = p.b.fixed("surround", 1.5);
  p.least_noise = 0.005;
  for (const double wavelength_nm : {450.0, 500.0, 550.0, 600.0, 650.0})
    for (const double analyzer_deg : {90.0, 45.0}) {
      s.microscope.wavelength_nm = p.b.fixed("wavelength", wavelength_nm);
      s.microscope.analyzer_deg = p.b.fixed("analyzer", analyzer_deg);
      p.scenes.push_back(s);
    }
}

/// Between which polarizers, and in which light, a cell is looked at.
struct CellViews {
  std::vector<std::array<double, 2>> pairs_deg;  ///< polarizer, analyser
  std::vector<double> wavelengths_nm;
};

/// The six pairs of the twisted cell that comes with the program, or as many at random.
inline CellViews draw_views(RandomProblem& p, int fewest_colours, int most_colours) {
  CellViews v{{{0, 0}, {0, 90}, {45, 45}, {45, 135}, {20, 80}, {70, 10}}, {}};
  if (p.chance(0.5))
    for (auto& pair : v.pairs_deg) pair = {p.between(0, 180), p.between(0, 180)};
  const int colours = p.count(fewest_colours, most_colours);
  for (int i = 0; i < colours; ++i) v.wavelengths_nm.push_back(p.between(440, 680));
  return v;
}

/// The light of a cell at a wavelength (um), polarizer and analyser (deg).
using CellLight = std::function<double(double, double, double)>;

/// Adds an image for every view, and the empty field between parallel and crossed polarizers, without which gain and
/// offset would be free to make up for everything else. `light` empty: by the program.
inline void look(RandomProblem& p, Scene scene, const CellViews& views, const CellLight& light) {
  constexpr int kSide = 12;
  scene.view.width = scene.view.height = kSide;
  const auto image = [&](double wavelength_nm, const std::array<double, 2>& pair, double value) {
    scene.microscope.wavelength_nm = p.b.fixed("wavelength", wavelength_nm);
    scene.microscope.polarizer_deg = p.b.fixed("polarizer", pair[0]);
    scene.microscope.analyzer_deg = p.b.fixed("analyzer", pair[1]);
    p.scenes.push_back(scene);
    if (light) p.light.emplace_back(kSide * kSide, value);
  };
  for (const double nm : views.wavelengths_nm)
    for (const auto& pair : views.pairs_deg) image(nm, pair, light ? light(1e-3 * nm, pair[0], pair[1]) : 0);
  std::get<ConstantIndices>(scene.material).birefringence = p.b.fixed("no_birefringence", 0);
  image(views.wavelengths_nm[0], {0, 0}, 1);
  image(views.wavelengths_nm[0], {0, 90}, 0);
}

/// The lamp is steady in most problems. With few images its unsteadiness could not be told from the cell.
inline void maybe_unsteady(RandomProblem& p, const CellViews& views) {
  if (views.pairs_deg.size() * views.wavelengths_nm.size() >= 16 && p.chance(0.5)) p.lamp_jitter = p.scaled(1e-3, 5e-3);
}

/// n_e - n_o as light along z meets it: 1/n^2 = sin^2 tilt / n_o^2 + cos^2 tilt / n_e^2.
inline double birefringence_along_z(double n_o, double birefringence, double tilt_deg) {
  const double s = std::sin(tilt_deg * M_PI / 180), c = std::cos(tilt_deg * M_PI / 180), n_e = n_o + birefringence;
  return n_o * n_e / std::hypot(n_e * s, n_o * c) - n_o;
}

/// What of a cell's retardance is searched: light along z knows only the product of thickness and
/// birefringence_along_z.
struct CellSize {
  ParameterRef thickness_um, birefringence, tilt_deg;
  double retardance_um = 0;
};
/// `most_tilt_deg` above 0: the tilt may be what is searched. The sign of the tilt cannot be told at normal incidence
/// (the director enters as n n, and light along z sees of it what lies across z), so that it is searched from 0 up.
inline CellSize draw_size(RandomProblem& p, double most_waves, double most_tilt_deg) {
  const double ordinary = 1.5, birefringence = p.scaled(0.02, 0.4);
  const double thickness = p.scaled(2, std::min(30.0, most_waves * 0.55 / birefringence));
  const int unknown = p.count(0, most_tilt_deg > 0 ? 2 : 1);
  CellSize size;
  size.thickness_um =
      unknown == 0 ? p.around("thickness_um", thickness, 0.25, 0.3) : p.b.fixed("thickness_um", thickness);
  const double lower = birefringence * p.between(0.3, 0.9), upper = birefringence * p.between(1.1, 1.8);
  size.birefringence = unknown == 1 ? p.b.fitted("birefringence", birefringence, lower, upper)
                                    : p.b.fixed("birefringence", birefringence);
  if (unknown == 2)
    size.tilt_deg = p.from_zero("tilt_deg", most_tilt_deg);
  else
    size.tilt_deg = p.b.fixed("tilt_deg", p.chance(0.5) ? 0 : p.between(0, most_tilt_deg));
  size.retardance_um = thickness * birefringence_along_z(ordinary, birefringence, p.truth_of(size.tilt_deg));
  return size;
}

/// Either the director at the entry is searched, or how the sample lies on the stage, or both are known. Period 90
/// degrees: a quarter turn of the axes with the indices exchanged is the same up to the sign of the retardance, which
/// pictures between linear polarizers do not show (C20), where nothing is reflected.
struct CellAngle {
  ParameterRef azimuth_deg, rotation_deg;
  double sum_deg = 0;
};
inline CellAngle draw_angle(RandomProblem& p, bool searched) {
  CellAngle angle;
  const int unknown = p.count(searched ? 1 : 0, 2);
  angle.azimuth_deg = unknown == 1 ? p.angle("azimuth_deg", 90) : p.b.fixed("azimuth_deg", p.between(0, 180));
  angle.rotation_deg = unknown == 2 ? p.angle("rotation", 90) : p.b.fixed("rotation", 0);
  angle.sum_deg = p.truth_of(angle.azimuth_deg) + p.truth_of(angle.rotation_deg);
  return angle;
}

inline Scene cell_scene(RandomProblem& p, const CellSize& size, const CellAngle& angle, const Cell& sample) {
  Scene s = seen(p, 1, 1);
  s.view.rotation_deg = angle.rotation_deg;
  s.sample = sample;
  s.material = ConstantIndices{p.b.fixed("ordinary", 1.5), size.birefringence};
  s.surround_index = p.b.fixed("surround", 1.5);
  p.demand.ceiling = Ceiling::e_only;  // what the independent models compute
  return s;
}

inline CellLight light_of(const CellSize& size, double twist_deg, double azimuth_deg) {
  return [=](double wavelength_um, double polarizer_deg, double analyzer_deg) {
    return IndependentCell{1, size.retardance_um, twist_deg, azimuth_deg, wavelength_um}.intensity(polarizer_deg,
                                                                                                   analyzer_deg);
  };
}

/// Planar or tilted: in one light every order of the retardance is the same, so that there are at least three.
inline void uniform_cell(RandomProblem& p) {
  const CellViews views = draw_views(p, 3, 5);
  const CellSize size = draw_size(p, 12, 80);
  const CellAngle angle = draw_angle(p, true);
  const Scene s =
      cell_scene(p, size, angle, Cell{size.thickness_um, UniformDirector{{}, angle.azimuth_deg, size.tilt_deg}});
  look(p, s, views, light_of(size, 0, angle.sum_deg));
  maybe_unsteady(p, views);
}

/// The twist is searched from 10 to 180 degrees, right-handed.
inline void twisted_cell(RandomProblem& p) {
  const CellViews views = draw_views(p, 1, 3);
  const CellSize size = draw_size(p, 5, 30);
  const CellAngle angle = draw_angle(p, false);
  const ParameterRef twist = p.anywhere("twist_deg", 10, 180);
  const Scene s =
      cell_scene(p, size, angle, Cell{size.thickness_um, TwistedDirector{twist, angle.azimuth_deg, size.tilt_deg}});
  look(p, s, views, light_of(size, p.truth_of(twist), angle.sum_deg));
  maybe_unsteady(p, views);
}

}  // namespace birefit::testing
