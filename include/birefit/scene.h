#pragma once
// What is in front of the camera: a sample, its material and surround, the microscope. A scene is immutable and holds
// no numbers of its own: every number that may vary is a ParameterRef into the job's table (parameters.h).
// Frames, signs and units: docs/conventions.md. Sources: docs/methods.md.

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "birefit/parameters.h"

namespace birefit {

// ---- materials ------------------------------------------------------------------------------------------------------

/// n_e = n_o + birefringence, neither depends on anything. Ranges: n_o in [1, 4], birefringence in [-1, 1].
struct ConstantIndices {
  ParameterRef ordinary;
  ParameterRef birefringence;
  /// If given, birefringence is that at 589.3 nm and varies as w^2 / (w^2 - resonance^2) with the wavelength w (one
  /// absorption band; Wu, Phys. Rev. A 33, 1270 (1986)); resonance below the wavelength.
  ParameterRef resonance_nm = {};
};

/// Steinberg TOG 2020 eq. 38, named preset "E44-steinberg2020": n_o = 1.53, n_e = 2.1942 - T / (750 K), 640 nm.
/// Not a physical E44 (docs/methods.md); T in [250, 373] K.
struct E44Steinberg2020 {
  ParameterRef temperature_k;  ///< ignored where the sample has its own temperature profile (heated plate)
};

/// The index of one ray against wavelength: a formula of refractiveindex.info by its number there, or a table.
/// Wavelengths in um, vacuum; holds from lower_um to upper_um only (docs/methods.md, "Materials").
struct Dispersion {
  enum class Form {
    sellmeier = 1,
    sellmeier_2,
    polynomial,
    refractiveindex_info,
    cauchy,
    gases,
    herzberger,
    retro,
    exotic,
    table
  };
  Form form = Form::cauchy;
  std::vector<double> coefficients;          ///< C1, C2, ..; exponents among them
  std::vector<ParameterRef> refs;            ///< empty, or as many: those given stand in for their coefficient
  std::vector<double> wavelength_um, index;  ///< of a table: growing, at least two
  double lower_um = 0, upper_um = 0;
};

/// Both rays against wavelength.
struct DispersiveIndices {
  Dispersion ordinary, extraordinary;
};

/// n_e = A - B T + 2/3 dn0 (1 - T/Tc)^b, n_o = A - B T - 1/3 dn0 (1 - T/Tc)^b (Li, Gauza, Wu 2004). Several sets: their
/// numbers are interpolated in 1/wavelength^2 between the wavelengths they were fitted at.
struct FourParameterIndices {
  struct Set {
    double wavelength_um = 0;       ///< 0: a single set, for the scene's wavelength
    ParameterRef mean_index;        ///< A
    ParameterRef mean_slope_per_k;  ///< B
    ParameterRef birefringence_0k;  ///< dn0, extrapolated to 0 K
    ParameterRef exponent;          ///< b
    ParameterRef clearing_k;        ///< Tc
  };
  std::vector<Set> sets;
};

/// Haller's law on indices known at one temperature: n_e - n_o is multiplied by ((1 - T/Tc)/(1 - T_ref/Tc))^exponent,
/// the mean (n_e + 2 n_o)/3 falls by mean_slope_per_k (T - T_ref). Both temperatures below the clearing point Tc.
struct HallerLaw {
  ParameterRef reference_k, clearing_k, exponent, mean_slope_per_k;
};

/// A material from the literature or a file: indices by wavelength, perhaps by temperature.
struct LawIndices {
  std::variant<ConstantIndices, DispersiveIndices, FourParameterIndices> indices;
  std::optional<HallerLaw> haller;    ///< of the first two
  ParameterRef temperature_k;         ///< where a temperature law needs one; ignored by a sample with its own profile
  ParameterRef birefringence_factor;  ///< n_e - n_o times this; not given: 1
  double lower_k = 0, upper_k = 0;    ///< where the temperature law holds; 0, 0: anywhere below the clearing point
  /// standard deviation of n_e - n_o over itself, 0 = not stated: enters the model error
  double birefringence_uncertainty = 0;
};

using Material = std::variant<ConstantIndices, E44Steinberg2020, LawIndices>;

// ---- director fields ------------------------------------------------------------------------------------------------

/// One fixed optic axis: either three components (normalised on use; a and -a are the same), or azimuth and tilt.
struct UniformDirector {
  std::array<ParameterRef, 3> axis;  ///< used when given
  ParameterRef azimuth_deg;          ///< from +x, counter-clockwise in the image
  ParameterRef tilt_deg;             ///< from the layer plane towards +z
};

/// Azimuth grows linearly with depth: azimuth(z) = azimuth_deg + twist_deg z/d; constant tilt = pretilt.
struct TwistedDirector {
  ParameterRef twist_deg;    ///< over the whole cell; > 0 is right-handed (x towards y as z grows)
  ParameterRef azimuth_deg;  ///< at the entry face
  ParameterRef pretilt_deg;
};

/// A nematic in a field along the cell's normal, strongly anchored at both faces: the equilibrium of its elastic and
/// dielectric energy (src/medium/families/equilibrium.h). Voltages are rms; the threshold of reduced_voltage is that of
/// the untwisted cell: pi sqrt(K11 / (eps0 |eps_par - eps_perp|)) for eps_par >= eps_perp, with K33 in place of K11
/// else.
struct FreederickszDirector {
  enum class Anchoring {
    planar,       ///< tilt = pretilt at both faces
    homeotropic,  ///< tilt = 90 degrees - pretilt at both faces; eps_par <= eps_perp
    hybrid,       ///< tilt = pretilt at the entry, 90 degrees at the exit
  } anchoring = Anchoring::planar;
  /// V / threshold; not given: voltage_v with threshold_v, or with k11_pn and both eps
  ParameterRef reduced_voltage;
  ParameterRef voltage_v, threshold_v;
  ParameterRef k33_over_k11, k22_over_k11, eps_ratio;  ///< eps_ratio = eps_par / eps_perp; k22 only with twist or pitch
  ParameterRef k11_pn, k22_pn, k33_pn, eps_parallel, eps_perpendicular;  ///< instead of the ratios
  ParameterRef pretilt_deg;                                              ///< [0, 45]
  ParameterRef azimuth_deg;                                              ///< at the entry face
  ParameterRef twist_deg;  ///< between the faces, > 0 right-handed; not given: none
  ParameterRef pitch_um;   ///< of the unstrained chiral nematic, > 0 right-handed; not given: none
};

/// Cholesteric helix along the normal: azimuth(z) = azimuth_deg + 360 degrees z / pitch, no tilt. With a modulus k in
/// [0, 1) the helix is partly unwound by a field in the layer plane along azimuth_deg + 90 degrees (de Gennes & Prost,
/// The Physics of Liquid Crystals, 6.2.2): azimuth = azimuth_deg + am(pi^2 z / (pitch E(k)) | k), field / critical
/// field = k / E(k).
struct HelixDirector {
  ParameterRef pitch_um;     ///< without field; > 0 right-handed
  ParameterRef azimuth_deg;  ///< at the entry face
  ParameterRef modulus;      ///< not given: no field
};

/// Radial hedgehog, n = r/|r|; with twist_deg != 0 the radial field turned about the optical axis by
/// twist_deg (1 - r/R): homeotropic at the surface, twisted inside (no equilibrium, a fully coupled test scene).
struct RadialDirector {
  ParameterRef twist_deg;  ///< not given: no twist, diagonal transport
};

/// Normal anchoring, an electric field along the viewing axis or in the image plane, positive dielectric anisotropy,
/// one elastic constant (Humar et al., Opt. Express 17, 2009): a point hedgehog that a field turns into a wall across
/// the equator, or, with ring_radius, an equatorial disclination ring. An image tells one number: e = radius /
/// coherence length, the coherence length being sqrt(K / (eps0 deps)) / local field. Given as it is, or as
/// field_v_per_um with what makes e of it: e = (diameter / 2) local_field_factor field_v_per_um / coherence_voltage_v.
struct AxialDirector {
  ParameterRef reduced_field;        ///< e, [0, 60]; or, when not given, the following three
  ParameterRef field_v_per_um;       ///< applied field, rms
  ParameterRef coherence_voltage_v;  ///< sqrt(K / (eps0 deps)): 0.27 V for 5CB, 0.34 V for E7
  ParameterRef local_field_factor;   ///< field in the droplet over applied field
  ParameterRef ring_radius;          ///< of the droplet's radius, [0.2, 0.995]; not given: hedgehog
  ParameterRef field_azimuth_deg;    ///< field in the image plane, from +x; not given: along the view
  bool compare = false;              ///< a fit tries the hedgehog, too (FitJob::branches)
};

/// Tangential anchoring: the director follows the circles through two poles (Williams, J. Phys. A 19, 3211 (1986)).
struct BipolarDirector {
  ParameterRef azimuth_deg;    ///< of the poles' axis, from +x; not given: 0
  ParameterRef tilt_deg;       ///< of that axis out of the image plane, towards +z; not given: 0
  ParameterRef pole_distance;  ///< from the centre, in radii, >= 1: 1 on the surface, large uniform; not given: 1
};

/// Liquid crystal between a sphere and an isotropic core, normal anchoring at both: radial where the core is in the
/// middle, the normals of nested spheres otherwise. Straight rays are not refracted at the core, curved ones and waves
/// are.
struct ShellDirector {
  ParameterRef wall_um;                        ///< difference of the two radii
  std::array<ParameterRef, 3> offset_um = {};  ///< of the core's centre; all or none. The sign of z is not observable
  /// not given: the surround's. Of straight rays it only judges what refraction at the core would change
  ParameterRef core_index;
};

// ---- samples --------------------------------------------------------------------------------------------------------

/// Spherical droplet or shell in an isotropic host; refraction at the sphere, focus on the mid plane.
struct Droplet {
  ParameterRef diameter_um;
  std::variant<RadialDirector, AxialDirector, BipolarDirector, ShellDirector> director;
};

/// Plane-parallel cell, seen along its normal.
struct Cell {
  ParameterRef thickness_um;
  std::variant<UniformDirector, TwistedDirector, FreederickszDirector, HelixDirector> director;
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
};

/// Arbitrary depth profile (profile.csv of docs/configuration.md).
struct SlabProfile {
  enum class Interpolation { constant, linear, cubic };
  struct Row {
    double depth_um, ax, ay, az, n_o, n_e, k_o, k_e;
  };
  std::vector<Row> rows;  ///< axis normalised; at least 1 (constant) or 2 (linear), 4 (cubic)
  Interpolation interpolation = Interpolation::constant;
};
struct Slab {
  SlabProfile profile;
  /// of a converging cone in the outside medium, (0, 80]; none: the microscope's directions
  ParameterRef half_angle_deg;
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
};

struct VolumeGrid;  // birefit/volume.h
/// A director field known at the nodes of a box, seen along its z: straight parallel rays, no refraction, nothing
/// reflected; or Ceiling::wave, in a host of Scene::surround_index, which is also where a node's tensor is zero. n_e -
/// n_o is the material's times the field's relative order. The middle of the box is seen at View::center_x_px,
/// center_y_px.
struct SampledVolume {
  std::shared_ptr<const VolumeGrid> grid;  ///< never null where a scene is planned or rendered
  ParameterRef scale;                      ///< of the box, all three sides, > 0; not given: 1
};

using Sample = std::variant<Droplet, Cell, Plate, Crystal, Slab, StressedDisc, SampledVolume>;

// ---- microscope -----------------------------------------------------------------------------------------------------

/// A direction in the outside medium.
struct Direction {
  double theta_deg = 0;    ///< from +z, [0, 90)
  double azimuth_deg = 0;  ///< of the plane of incidence, from +x
};

/// A lossless plate between a polarizer and the sample: the field along its slow axis is behind the other by the phase.
struct Retarder {
  ParameterRef phase_deg;      ///< at the light's wavelength; or, when not given,
  ParameterRef retardance_nm;  ///< which is the same at all wavelengths
  ParameterRef azimuth_deg;    ///< of the slow axis, from +x
  double turned_deg = 0;       ///< added to it: of a plate that is mounted at an angle to a polarizer
};
/// Turns the polarization by angle_deg, counter-clockwise in the image.
struct Rotator {
  ParameterRef angle_deg;
};
using PolarizingPart = std::variant<Retarder, Rotator>;

struct Microscope {
  ParameterRef wavelength_nm;  ///< vacuum
  ParameterRef polarizer_deg;  ///< not given: none, the light that comes in is unpolarized
  ParameterRef analyzer_deg;   ///< not given: none, all that leaves the sample is seen
  /// Flux that is let through along the polarizer over flux across it, both as they come in; >= 1; not given: ideal.
  ParameterRef polarizer_extinction_ratio, analyzer_extinction_ratio;
  /// Between polarizer and sample, between sample and analyser; in the order in which light meets them.
  std::vector<PolarizingPart> before, behind;
  double bandwidth_nm = 0;  ///< FWHM, 0 = not stated; modelled by discs (a Gaussian), else it enters the model error
  double condenser_na = 0;  ///< 0 = not stated; not modelled: enters the model error
  /// 0 = not stated. Waves: the objective's band limit; droplet rays leaving steeper than this are lost.
  double objective_na = 0;
  /// focal plane, from the middle of the sample along the light; not given: 0. Ceiling::wave only
  ParameterRef focus_um;
  bool aplanatic = false;             ///< imaging: focal_plane (default) or aplanatic, docs/conventions.md
  std::vector<Direction> directions;  ///< slab scenes
};

/// A camera that looks at a cone's screen from the side: a pinhole whose axis points at the cone's middle.
struct SideCamera {
  /// it stands in the direction (tan tilt_x, tan tilt_y, 1) of the screen, x right, y up; [-80, 80]
  ParameterRef tilt_x_deg, tilt_y_deg;
  /// what half the picture's smaller side subtends, [0, 60]; 0: from far away, no perspective
  ParameterRef half_field_deg;
};

/// How pixels lie on the sample.
struct View {
  int width = 0, height = 0;
  double pixel_size_um = 0;  ///< 0 for conoscopic plates, cells and crystals that need none
  ParameterRef center_x_px;  ///< sample centre; pixel centres are integers, (0, 0) the top left pixel's
  ParameterRef center_y_px;
  ParameterRef rotation_deg;         ///< of the sample, counter-clockwise as seen in the image
  std::optional<SideCamera> camera;  ///< of plates and slabs in a cone; none: it looks along the cone's axis
};

/// The physics ceiling: what a render may leave out (docs/methods.md).
enum class Ceiling {
  one_way,      ///< E and H continuous, backward waves dropped (default)
  e_only,       ///< only tangential E continuous: the source paper's
  reflections,  ///< all of Maxwell's equations in the layers, both faces included; cells and slabs
  /// wave optics: radial droplets and concentric shells exactly, other spheres and sampled fields without reflections.
  /// Needs Microscope::objective_na
  wave,
};

/// How light runs through a droplet: both modes on the refracted straight chord, or each on its own ray (geometrical
/// optics; has_curved_rays in render.h). What follows from the choice: docs/methods.md.
enum class Rays { straight, eikonal };

struct Scene {
  Sample sample;
  Material material;
  ParameterRef surround_index;
  std::optional<Dispersion> surround_dispersion;  ///< instead of surround_index
  Microscope microscope;
  View view;
  Ceiling ceiling = Ceiling::one_way;
  Rays rays = Rays::straight;
  double intensity_accuracy = 1e-4;  ///< numerical error of the intensity the planner must hold
  std::string method = "auto";       ///< or a transport method's name
};

}  // namespace birefit
