#pragma once
// One picture of every kind of sample.

#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "birefit/render.h"
#include "birefit/volume.h"
#include "study/frames.h"

namespace birefit::testing {

struct Kind {
  std::string name;
  ParameterTable table;
  Scene scene;
  Demand demand;
  std::vector<int> four;  ///< to differentiate by; fewer where the kind has fewer

  ParameterRef number(const std::string& what, double value) { return table.add_constant(what, value); }
  ParameterRef moving(const std::string& what, double value) {
    const ParameterRef ref = number(what, value);
    if (four.size() < 4) four.push_back(ref.index);
    return ref;
  }
};

namespace kinds_of_sample {

/// Between crossed polarizers, ordinary 1.52, birefringence 0.22, at 590 nm.
inline Kind scene_of(std::string name, int size, double pixel_um, Sample (*sample)(Kind&)) {
  Kind k;
  k.name = std::move(name);
  k.scene.view.width = k.scene.view.height = size;
  k.scene.view.pixel_size_um = k.number("pixel_size_um", pixel_um);
  k.scene.sample = sample(k);
  ConstantIndices material;
  material.birefringence = k.moving("birefringence", 0.22);
  material.ordinary = k.number("ordinary", 1.52);
  k.scene.material = material;
  k.scene.surround_index = k.number("index", 1.43);
  k.scene.view.center_x_px = k.moving("center_x", 0.5 * size + 0.3);
  k.scene.view.center_y_px = k.moving("center_y", 0.5 * size - 0.2);
  k.scene.microscope.wavelength_nm = k.moving("wavelength_nm", 590);
  k.scene.microscope.polarizer_deg = k.number("polarizer_deg", 0);
  k.scene.microscope.analyzer_deg = k.number("analyzer_deg", 90);
  return k;
}

inline Droplet droplet_of(Kind& k) {
  Droplet droplet;
  droplet.diameter_um = k.moving("diameter_um", 9.3);
  return droplet;
}
inline Sample radial(Kind& k) { return droplet_of(k); }
inline Sample twisted(Kind& k) {
  Droplet droplet = droplet_of(k);
  droplet.director = RadialDirector{k.number("twist_deg", 60)};
  return droplet;
}
inline Droplet shell_of(Kind& k) {
  Droplet droplet = droplet_of(k);
  ShellDirector shell;
  shell.wall_um = k.number("wall_um", 1.3);
  droplet.director = shell;
  return droplet;
}
inline Sample shell(Kind& k) { return shell_of(k); }
inline Sample eccentric_shell(Kind& k) {
  Droplet droplet = shell_of(k);
  std::get<ShellDirector>(droplet.director).offset_um = {k.number("offset_x", 0.4), k.number("offset_y", -0.2),
                                                         k.number("offset_z", 0.3)};
  return droplet;
}
inline Sample bipolar(Kind& k) {
  Droplet droplet = droplet_of(k);
  BipolarDirector director;
  director.azimuth_deg = k.number("azimuth_deg", 35);
  director.tilt_deg = k.number("tilt_deg", 20);
  droplet.director = director;
  return droplet;
}
inline Droplet in_field_of(Kind& k) {
  Droplet droplet = droplet_of(k);
  AxialDirector axial;
  axial.reduced_field = k.number("reduced_field", 3);
  droplet.director = axial;
  return droplet;
}
inline Sample in_field(Kind& k) { return in_field_of(k); }
inline Sample in_field_across(Kind& k) {
  Droplet droplet = in_field_of(k);
  std::get<AxialDirector>(droplet.director).field_azimuth_deg = k.number("field_azimuth_deg", 35);
  return droplet;
}
inline Sample bar(Kind& k) {
  Crystal crystal;
  crystal.half_wave_voltage_v = k.number("half_wave_voltage_v", 1500);
  crystal.bias_v = k.moving("bias_v", 2700);
  crystal.slow_axis_deg = k.number("slow_axis_deg", 45);
  crystal.field_legendre = {k.moving("c1", 0.1), k.moving("c2", 0.05), k.number("c3", 0.02)};
  return crystal;
}
inline Sample disc(Kind& k) {
  StressedDisc disc;
  disc.diameter_um = k.moving("disc_um", 40000);
  disc.thickness_um = k.number("thickness_um", 6000);
  disc.load_n = k.moving("load_n", 800);
  disc.stress_optic_brewster = k.number("stress_optic_brewster", 80);
  return disc;
}
inline Sample cell(Kind& k) {
  Cell cell;
  cell.thickness_um = k.moving("thickness_um", 8);
  TwistedDirector director;
  director.twist_deg = k.moving("twist_deg", 80);
  director.azimuth_deg = k.number("azimuth_deg", 10);
  director.pretilt_deg = k.number("pretilt_deg", 2);
  cell.director = director;
  return cell;
}
inline Sample cell_in_field(Kind& k) {
  Cell cell;
  cell.thickness_um = k.moving("thickness_um", 8);
  FreederickszDirector director;
  director.reduced_voltage = k.moving("reduced_voltage", 1.7);
  director.k33_over_k11 = k.number("k33_over_k11", 1.4);
  director.eps_ratio = k.number("eps_ratio", 2.5);
  director.pretilt_deg = k.number("pretilt_deg", 2);
  director.azimuth_deg = k.number("azimuth_deg", 45);
  cell.director = director;
  return cell;
}
/// A cell of 64 x 64 x 24 nodes whose director winds once across and tilts in the middle.
inline Sample volume(Kind& k) {
  auto grid = std::make_shared<VolumeGrid>();
  grid->nx = grid->ny = 64, grid->nz = 24;
  grid->spacing_um = {0.2, 0.2, 0.2};
  for (int z = 0; z < grid->nz; ++z)
    for (int y = 0; y < grid->ny; ++y)
      for (int x = 0; x < grid->nx; ++x) {
        const double azimuth = 2 * std::numbers::pi * x / grid->nx + 0.03 * y + 0.04 * z,
                     tilt = 0.6 * std::sin(std::numbers::pi * z / (grid->nz - 1.0));
        grid->nodes.push_back(
            director_tensor(std::cos(tilt) * std::cos(azimuth), std::cos(tilt) * std::sin(azimuth), std::sin(tilt)));
      }
  SampledVolume sample;
  sample.grid = std::move(grid);
  sample.scale = k.moving("scale", 1);
  return sample;
}

}  // namespace kinds_of_sample

/// Droplets of 9.3 um on 500 x 500 pixels, others at sizes that show what they have; frames of the charts for the rest.
inline std::vector<Kind> every_kind() {
  using namespace kinds_of_sample;
  std::vector<Kind> all;
  constexpr int kSize = 500;
  constexpr double kPixelUm = 0.025;
  const auto add = [&](const char* name, int size, double pixel_um, Sample (*sample)(Kind&)) -> Kind& {
    all.push_back(scene_of(name, size, pixel_um, sample));
    return all.back();
  };
  add("radial", kSize, kPixelUm, radial);
  add("twisted", kSize, kPixelUm, twisted);
  add("shell", kSize, kPixelUm, shell);
  add("in_field", kSize, kPixelUm, in_field);
  add("bipolar", kSize, kPixelUm, bipolar);
  add("in_field_across", kSize, kPixelUm, in_field_across);
  add("eccentric_shell", kSize, kPixelUm, eccentric_shell);
  add("bar", kSize, 1, bar);
  add("disc", kSize, 90, disc);
  add("cell", 8, 0, cell);
  add("cell_in_field", 8, 0, cell_in_field);
  add("volume", 200, 0.07, volume);
  add("curved", 128, 0.1, radial).demand.rays = Rays::eikonal;
  add("curved_shell", 128, 0.1, shell).demand.rays = Rays::eikonal;
  for (const bool exactly : {true, false}) {
    Kind& kind = add(exactly ? "waves_series" : "waves_propagated", 160, 0.08, exactly ? radial : bipolar);
    kind.demand.ceiling = Ceiling::wave;
    kind.scene.microscope.objective_na = kind.number("objective_na", 0.8);
  }
  for (birefit::study::FrameScene& f : birefit::study::frame_scenes()) {
    if (std::holds_alternative<Droplet>(f.scene.sample)) continue;
    all.push_back(
        {f.name, std::move(f.table), std::move(f.scene), {}, {f.parameters.begin(), f.parameters.begin() + 4}});
  }
  return all;
}

inline constexpr int kSmallSide = 8;
/// The kind's picture on so many pixels a side.
inline Kind small(Kind kind) {
  View& view = kind.scene.view;
  const double share = static_cast<double>(view.width) / kSmallSide;
  const auto place = [&](ParameterRef& ref) {
    if (ref) ref = kind.number("place", (kind.table.values()[static_cast<std::size_t>(ref.index)] + 0.5) / share - 0.5);
  };
  place(view.center_x_px), place(view.center_y_px);
  if (auto* crystal = std::get_if<Crystal>(&kind.scene.sample))
    place(crystal->electrode_low_px), place(crystal->electrode_high_px);
  view.width = view.height = kSmallSide;
  double pixel_um = share * kind.table.values()[static_cast<std::size_t>(view.pixel_size_um.index)];
  // Waves are sent through a box as large as the droplet: half of it costs an eighth.
  if (auto* droplet = std::get_if<Droplet>(&kind.scene.sample); droplet && kind.demand.ceiling == Ceiling::wave)
    droplet->diameter_um = kind.number("diameter", 4), pixel_um *= 0.5;
  view.pixel_size_um = kind.number("pixel_size_um", pixel_um);
  return kind;
}
inline std::vector<Kind> every_kind_small() {
  std::vector<Kind> all;
  for (Kind& kind : every_kind()) all.push_back(small(std::move(kind)));
  return all;
}

}  // namespace birefit::testing
