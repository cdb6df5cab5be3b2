#pragma once
// What is in front of the objective: droplets, shells, cells, plates, bars, slabs, discs, sampled fields.

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "birefit/director.h"

namespace birefit {

/// Spherical droplet or shell in an isotropic host; refraction at the sphere, focus on the mid plane.
struct Droplet {
  ParameterRef diameter_um;
  DropletDirector director;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("diameter_um", self.diameter_um, numbers::length_um(10000).found_in_pictures(), "of the sphere");
    visit.inside("director", self.director);
  }
};

/// Plane-parallel cell, seen along its normal.
struct Cell {
  ParameterRef thickness_um;
  CellDirector director;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("thickness_um", self.thickness_um, numbers::length_um(10000).known_within_share(0.005),
                 "between the faces");
    visit.inside("director", self.director);
  }
};

/// Heat conduction in a plate at one temperature whose faces are held at cold_k (z = 0) and hot_k (z = d) since a time
/// fourier_number d^2 / diffusivity ago (Carslaw & Jaeger, Conduction of Heat in Solids, 3.4; physics of
/// docs/methods.md).
struct HeatStep {
  ParameterRef fourier_number;     ///< > 0; or, when not given, the following two
  ParameterRef time_s;             ///< since the step, > 0
  ParameterRef diffusivity_mm2_s;  ///< > 0
  ParameterRef cold_k;
  ParameterRef hot_k;
  ParameterRef initial_k;  ///< before the step; not given: cold_k. Equal faces: a step from both sides

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("fourier_number", self.fourier_number, numbers::positive(1e4).physical().left_out(),
                 "diffusivity time / thickness^2; or");
    visit.number("time_s", self.time_s, numbers::positive(1e9, "s").left_out(), "since the step, with");
    visit.number("diffusivity_mm2_s", self.diffusivity_mm2_s, numbers::positive(1e4, "mm2/s").left_out(), "of heat");
    visit.number("initial_k", self.initial_k, numbers::within(100, 2000, "K").left_out(),
                 "before the step; not given: cold_k");
    visit.number("cold_k", self.cold_k, numbers::within(100, 2000, "K"), "of the face z = 0");
    visit.number("hot_k", self.hot_k, numbers::within(100, 2000, "K"), "of the face z = d");
  }
};

/// Plate with a fixed optic axis seen in a converging cone: image radius proportional to tan(incidence), half the
/// smaller image side (pixel edge to pixel edge) at half_angle_deg. Conoscopic: an image of directions.
struct Plate {
  ParameterRef thickness_um;
  UniformDirector director;
  std::variant<std::monostate, HeatStep> heat;
  ParameterRef half_angle_deg;  ///< in the outside medium, (0, 80]; none: a table of rings, below
  /// Without a picture: dark rings on a screen (Quantity::ring_radius_cm); plates cut normal to the axis only.
  ParameterRef screen_distance_um;  ///< from the middle of the plate
  ParameterRef ring_offset;         ///< of the numbering; not given: 0

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("thickness_um", self.thickness_um, numbers::length_um(100000).known_within_share(0.005),
                 "between the faces");
    visit.number("view.half_angle_deg", self.half_angle_deg, numbers::positive(80, "deg").left_out(),
                 "of the cone, half the smaller image side");
    visit.number("view.screen_distance_um", self.screen_distance_um, numbers::length_um(1e8).left_out(),
                 "from the middle of the plate to a screen with rings");
    visit.number("view.ring_offset", self.ring_offset, numbers::within(-100, 100).left_out(),
                 "of the numbering of rings");
    visit.inside("director", self.director);
    visit.inside("heat", self.heat);
  }
};

/// Cubic crystal bar made birefringent by a transverse field. Retardance of a pixel = pi E d / half_wave_voltage_v with
/// E d the local field times the electrode distance. Uniform: E d = bias_v + built_in_bias_v = V. Varying: E d = V (1 +
/// sum_j c_j P_j(t)), t in [-1, 1] across the electrodes, P_j Legendre polynomials j = 1, 2, ..: the integral over the
/// bar is the bias.
struct Crystal {
  ParameterRef half_wave_voltage_v;
  ParameterRef bias_v;  ///< sign not observable
  /// what the field across the bar has without a bias, counted along it; not given: 0
  ParameterRef built_in_bias_v;
  bool field_along_y = true;                 ///< else along x
  ParameterRef slow_axis_deg;                ///< azimuth of the induced axis; 45 degrees from the field by default
  std::vector<ParameterRef> field_legendre;  ///< c_1, c_2, ..; empty = uniform
  /// Pixel rows (field along y; columns otherwise) of the electrodes, edge to edge; empty refs = the image's edges.
  ParameterRef electrode_low_px, electrode_high_px;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("half_wave_voltage_v", self.half_wave_voltage_v, numbers::positive(1e7, "V").physical(),
                 "by which the retardance is half a wave");
    visit.number("bias_v", self.bias_v, numbers::within(0, 1e7, "V").physical(), "the sign is not observable");
    visit.number("built_in_bias_v", self.built_in_bias_v, numbers::within(-1e7, 1e7, "V").left_out(),
                 "what the field has without a bias");
    visit.number("slow_axis_deg", self.slow_axis_deg, numbers::angle().left_out(),
                 "of the induced axis; not given: 45 degrees from the field");
    visit.list("field_legendre", self.field_legendre, numbers::within(-100, 100).left_out(),
               "c_1, c_2, .. of the field across the bar");
    visit.number("electrodes_px.low", self.electrode_low_px, numbers::within(-1e6, 1e6, "px").left_out(),
                 "edge of one electrode");
    visit.number("electrodes_px.high", self.electrode_high_px, numbers::within(-1e6, 1e6, "px").left_out(),
                 "of the other");
  }
};

/// Arbitrary depth profile (profile.csv of docs/configuration.md).
struct SlabProfile {
  /// constant: a row is a layer; else rows are nodes, between them straight lines or a natural cubic spline.
  enum class Interpolation { constant, linear, cubic };
  /// Depth below the entry face (um; constant: of the layer's lower face; nodes: the first at 0), optic axis, and
  /// indices n + i k of both rays.
  struct Row {
    double depth_um, ax, ay, az, n_o, n_e, k_o, k_e;
  };
  std::vector<Row> rows;  ///< axis normalised; at least 1 (constant) or 2 (linear), 4 (cubic)
  Interpolation interpolation = Interpolation::constant;
};

/// Any stratified slab; its profile is known.
struct Slab {
  SlabProfile profile;
  /// of a converging cone in the outside medium, (0, 80]; none: the microscope's directions
  ParameterRef half_angle_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("view.half_angle_deg", self.half_angle_deg, numbers::positive(80, "deg").left_out(),
                 "of the cone, half the smaller image side");
  }
};

/// Disc pressed together across a diameter, plane stress (docs/methods.md, "Photoelastic disc"). Retardance =
/// stress_optic x thickness x difference of the principal stresses. Lengths are those of View::pixel_size_um.
struct StressedDisc {
  ParameterRef diameter_um;
  ParameterRef thickness_um;
  ParameterRef load_n;                 ///< >= 0; the pattern's sign is not observable
  ParameterRef stress_optic_brewster;  ///< 1e-12/Pa
  ParameterRef load_azimuth_deg;       ///< of the line of the two forces, from +x; not given: 90
  double contact_radius_um = 0;        ///< around the two load points nothing is fitted; 0 = a tenth of the radius
  double rim_um = 0;                   ///< the same along the edge; 0 = a fiftieth of the radius
  /// Residual stress sxx - syy and 2 sxy in MPa, in the frame of the load (y along it): coefficients of 1, X, Y, X^2,
  /// XY, Y^2, X^3, .. with X, Y in units of the radius; empty = none.
  std::vector<ParameterRef> residual_normal_mpa, residual_shear_mpa;
  /// Uneven light: the brightness is 1 + c1 X + c2 Y + c3 X^2 + c4 XY + .., X right and Y up in the image, from the
  /// disc's centre in units of its radius; empty = even.
  std::vector<ParameterRef> illumination;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("diameter_um", self.diameter_um, numbers::length_um(1e7).known_within_share(0.005), "of the disc");
    visit.number("thickness_um", self.thickness_um, numbers::length_um(1e7).or_else(1000).known_within_share(0.005),
                 "matters to residual stress alone, which needs it");
    visit.number("load_n", self.load_n, numbers::within(0, 1e7, "N").physical(), "pressing it together");
    visit.number("stress_optic_brewster", self.stress_optic_brewster, numbers::within(-1e5, 1e5, "brewster"),
                 "1e-12/Pa");
    visit.number("load_azimuth_deg", self.load_azimuth_deg, numbers::dial().or_else(90),
                 "of the line of the two forces");
    visit.list("residual.normal_mpa", self.residual_normal_mpa, numbers::within(-1e6, 1e6, "MPa").left_out(),
               "of sxx - syy");
    visit.list("residual.shear_mpa", self.residual_shear_mpa, numbers::within(-1e6, 1e6, "MPa").left_out(), "of 2 sxy");
    visit.list("illumination", self.illumination, numbers::within(-100, 100).left_out(),
               "uneven light by X, Y, X^2, ..");
  }
};

struct VolumeGrid;  // birefit/volume.h
/// A director field known at the nodes of a box, seen along its z: straight parallel rays, no refraction, nothing
/// reflected; or Ceiling::wave, in a host of Scene::surround_index, which is also where a node's tensor is zero. n_e -
/// n_o is the material's times the field's relative order. The middle of the box is seen at View::center_x_px,
/// center_y_px.
struct SampledVolume {
  std::shared_ptr<const VolumeGrid> grid;  ///< never null where a scene is planned or rendered
  ParameterRef scale;                      ///< of the box, all three sides, > 0; not given: 1

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("scale", self.scale, numbers::positive(1e6).physical().or_else(1), "of the box, all three sides");
  }
};

/// Kinds of samples.
using Sample = std::variant<Droplet, Cell, Plate, Crystal, Slab, StressedDisc, SampledVolume>;

}  // namespace birefit
