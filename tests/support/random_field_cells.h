#pragma once
// Random problems of cells whose director a field or a chirality bends: tables against voltage, images at several
// voltages, cholesteric helices.

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "independent_field_cell.h"
#include "random_cells.h"

namespace birefit::testing {

/// Retardance at a voltage over the threshold: regula falsi (Illinois) on IndependentFieldCell's integrals, whose own
/// bisection takes ten times as long.
inline double retardance_at(const IndependentFieldCell& cell, double voltage) {
  double low = -std::log1p(-std::pow(std::sin(cell.pretilt_deg * M_PI / 180), 2)) + 1e-16, high = 1;
  double below = -voltage, above = cell.at(high).v - voltage;
  while (above < 0) {
    low = high, below = above;
    high *= 2;
    above = cell.at(high).v - voltage;
  }
  int last = 0;
  for (int i = 0; i < 100; ++i) {
    const double w = (low * above - high * below) / (above - below);
    const IndependentFieldCell::Integrals here = cell.at(w);
    const double off = here.v - voltage;
    if (std::abs(off) < 1e-9) return here.retardance_um;
    const int side = off < 0 ? -1 : 1;
    (side < 0 ? low : high) = w;
    (side < 0 ? below : above) = off;
    if (side == last) (side < 0 ? above : below) *= 0.5;
    last = side;
  }
  return cell.retardance_um(voltage);
}

/// A planar cell at 45 degrees between crossed or parallel polarizers, its signal against voltage: each row a pixel.
inline void freedericksz_table(RandomProblem& p) {
  const double birefringence = p.scaled(0.05, 0.3);
  IndependentFieldCell model;
  model.n_e = model.n_o + birefringence;
  FreederickszDirector director;
  const ParameterRef thickness = p.length("thickness_um", 3, std::min(20.0, 4 / birefringence));
  director.threshold_v = p.around("threshold_v", p.between(0.7, 2), 0.25, 0.3);
  director.pretilt_deg = p.from_zero("pretilt_deg", 12);
  const double bend = p.between(0.7, 2);
  director.k33_over_k11 = p.chance(0.3) ? p.around("k33_over_k11", bend, 0.3, 0.4) : p.b.fixed("k33_over_k11", bend);
  director.eps_ratio = p.b.fixed("eps_ratio", p.between(1.5, 4.5));
  director.azimuth_deg = p.b.fixed("azimuth_deg", 45);
  model.thickness_um = p.truth_of(thickness);
  model.pretilt_deg = p.truth_of(director.pretilt_deg);
  model.k33_over_k11 = p.truth_of(director.k33_over_k11);
  model.eps_ratio = p.truth_of(director.eps_ratio);
  Scene s = seen(p, 1, 1);
  s.material = ConstantIndices{p.b.fixed("ordinary", model.n_o), p.b.fixed("birefringence", birefringence)};
  s.surround_index = p.b.fixed("surround", model.n_o);
  p.demand.ceiling = Ceiling::e_only;
  const double wavelength_um = p.between(0.45, 0.65);
  s.microscope.wavelength_nm = p.b.fixed("wavelength", 1000 * wavelength_um);
  const bool crossed = p.chance(0.7);
  if (!crossed) s.microscope.analyzer_deg = p.b.fixed("parallel", 0);
  const int rows = p.count(30, 50);
  const double threshold = p.truth_of(director.threshold_v), last = threshold * p.between(3, 6);
  for (int i = 0; i < rows; ++i) {
    const double voltage = 0.2 + (last - 0.2) * i / (rows - 1);
    director.voltage_v = p.b.fixed("voltage_v", voltage);
    s.sample = Cell{thickness, director};
    p.scenes.push_back(s);
    const double dark = std::pow(std::sin(M_PI / wavelength_um * retardance_at(model, voltage / threshold)), 2);
    p.light.push_back({crossed ? dark : 1 - dark});
  }
}

/// A nematic in a field, whatever its faces: images at one voltage or at several, those at several with the threshold
/// searched. Shown by the program's own render at high accuracy.
inline void field_cell(RandomProblem& p) {
  enum { planar, twisted, hybrid, cholesteric, homeotropic };
  const int kind = p.count(planar, homeotropic);
  CellViews views = draw_views(p, 2, 3);
  const double birefringence = p.scaled(0.04, 0.25), thickness = p.scaled(3, std::min(15.0, 3 / birefringence));
  FreederickszDirector d;
  d.anchoring = kind == hybrid        ? FreederickszDirector::Anchoring::hybrid
                : kind == homeotropic ? FreederickszDirector::Anchoring::homeotropic
                                      : FreederickszDirector::Anchoring::planar;
  CellSize size;
  CellAngle angle = draw_angle(p, false);
  d.azimuth_deg = angle.azimuth_deg;
  // One number more than the voltage, but where nothing twists an image at one voltage tells its retardance only.
  const bool one_voltage = p.chance(0.5), turns = kind == twisted || kind == cholesteric;
  const int unknown = one_voltage && !turns ? -1 : p.count(0, 3);
  const auto maybe = [&](int number, const std::string& name, double truth, double below, double above) {
    return unknown == number ? p.around(name, truth, below, above) : p.b.fixed(name, truth);
  };
  size.thickness_um = maybe(0, "thickness_um", thickness, 0.25, 0.3);
  d.k33_over_k11 = maybe(1, "k33_over_k11", p.between(0.7, 2.2), 0.4, 0.6);
  size.birefringence = maybe(2, "birefringence", birefringence, 0.25, 0.3);
  d.eps_ratio = p.b.fixed("eps_ratio", kind == homeotropic ? p.between(0.4, 0.8) : p.between(1.5, 4.5));
  d.pretilt_deg = unknown == 3 ? p.from_zero("pretilt_deg", 15) : p.b.fixed("pretilt_deg", p.between(0.5, 5));
  if (turns) {
    d.k22_over_k11 = p.b.fixed("k22_over_k11", p.between(0.4, 0.8));
    d.twist_deg = p.b.fixed("twist_deg", kind == twisted ? 90 : 180);
    if (kind == cholesteric) d.pitch_um = p.b.fixed("pitch_um", 2 * thickness * p.between(0.9, 1.1));
  }
  const auto add = [&](const FreederickszDirector& at) {
    look(p, cell_scene(p, size, angle, Cell{size.thickness_um, at}), views, {});
  };
  if (one_voltage) {
    d.reduced_voltage = p.from_zero("reduced_voltage", 4);
    add(d);
  } else {
    d.threshold_v = p.around("threshold_v", p.between(0.7, 2), 0.25, 0.3);
    const double threshold = p.truth_of(d.threshold_v);
    views.wavelengths_nm.resize(1);
    for (int i = p.count(3, 5); i > 0; --i) {
      d.voltage_v = p.b.fixed("voltage_v", threshold * p.between(0.8, 4));
      add(d);
    }
  }
}

/// A cholesteric without a field, or partly unwound by one along the layers.
inline void helix_cell(RandomProblem& p) {
  const CellViews views = draw_views(p, 1, 3);
  const double birefringence = p.scaled(0.03, 0.2), thickness = p.scaled(4, std::min(20.0, 2.5 / birefringence));
  const double hand = p.chance(0.5) ? 1 : -1, pitch = thickness / p.scaled(0.1, 1.5);
  const CellAngle angle = draw_angle(p, false);
  HelixDirector helix;
  const ParameterRef right = p.around("pitch_um", pitch, 0.25, 0.3);
  Parameter& searched = p.b.table[right];
  if (hand < 0) searched.value *= -1, searched.lower = std::exchange(searched.upper, -searched.lower) * -1;
  helix.pitch_um = right;
  helix.azimuth_deg = angle.azimuth_deg;
  const bool unwound = p.chance(0.4);
  if (unwound)
    helix.modulus = p.chance(0.5) ? p.from_zero("modulus", 0.98) : p.b.fixed("modulus", p.between(0.3, 0.95));
  CellSize size;
  size.thickness_um = p.b.fixed("thickness_um", thickness);
  size.birefringence =
      p.chance(0.4) ? p.around("birefringence", birefringence, 0.25, 0.3) : p.b.fixed("birefringence", birefringence);
  size.retardance_um = thickness * birefringence;
  const Scene s = cell_scene(p, size, angle, Cell{size.thickness_um, helix});
  look(p, s, views, unwound ? CellLight{} : light_of(size, hand * 360 * thickness / pitch, angle.sum_deg));
  maybe_unsteady(p, views);
}

}  // namespace birefit::testing
