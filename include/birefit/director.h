#pragma once
// Director fields: what the optic axis does from place to place. Frames, signs and units: docs/conventions.md. Sources:
// docs/methods.md.
//
// describe(self, visit) says of every number of a struct: its key in the config, itself, what it may be, one sentence.
// visit.number(key, ref, spec, words); visit.vector(key, three refs, spec, words) of components;
// visit.list(key, refs, spec, words) of coefficients; visit.inside(key, part), a struct, variant, list or nothing.
// kKey: its kind in the config.

#include <array>
#include <variant>

#include "birefit/number_spec.h"
#include "birefit/parameters.h"

namespace birefit {

/// One fixed optic axis: either three components (normalised on use; a and -a are the same), or azimuth and tilt.
struct UniformDirector {
  static constexpr const char* kKey = "uniform";
  std::array<ParameterRef, 3> axis;  ///< used when given
  ParameterRef azimuth_deg;
  ParameterRef tilt_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.vector("axis", self.axis, numbers::within(-1e6, 1e6).left_out(),
                 "the direction [x, y, z], of any length; instead of angles");
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial().or_else(0),
                 "from +x, counter-clockwise in the image");
    visit.number("tilt_deg", self.tilt_deg, numbers::angle().known_within(0.5).or_else(0),
                 "from the layer plane towards +z");
  }
};

/// Azimuth grows linearly with depth: azimuth(z) = azimuth_deg + twist_deg z/d; constant tilt = pretilt.
struct TwistedDirector {
  static constexpr const char* kKey = "twisted";
  ParameterRef twist_deg, azimuth_deg, pretilt_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("twist_deg", self.twist_deg, numbers::angle(),
                 "over the whole cell; > 0 is right-handed (x towards y as z grows)");
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial().or_else(0), "at the entry face");
    visit.number("pretilt_deg", self.pretilt_deg, numbers::angle(-90, 90).or_else(0),
                 "of the axis out of the layer plane");
  }
};

/// A nematic in a field along the cell's normal, strongly anchored at both faces: the equilibrium of its elastic and
/// dielectric energy (src/medium/families/equilibrium.h). Voltages are rms; the threshold of reduced_voltage is that of
/// the untwisted cell: pi sqrt(K11 / (eps0 |eps_par - eps_perp|)) for eps_par >= eps_perp, with K33 in place of K11
/// else.
struct FreederickszDirector {
  static constexpr const char* kKey = "freedericksz";
  /// What both faces do to the director there.
  enum class Anchoring {
    planar,       ///< tilt = pretilt at both faces
    homeotropic,  ///< tilt = 90 degrees - pretilt at both faces; eps_par <= eps_perp
    hybrid,       ///< tilt = pretilt at the entry, 90 degrees at the exit
  } anchoring = Anchoring::planar;
  ParameterRef reduced_voltage, voltage_v, threshold_v;
  ParameterRef k33_over_k11, k22_over_k11, eps_ratio;
  ParameterRef k11_pn, k22_pn, k33_pn, eps_parallel, eps_perpendicular;
  ParameterRef pretilt_deg, azimuth_deg, twist_deg, pitch_um;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("reduced_voltage", self.reduced_voltage, numbers::within(0, 50).physical().left_out(),
                 "V over the threshold");
    visit.number("voltage_v", self.voltage_v, numbers::within(0, 1e5, "V").physical().left_out(),
                 "rms; instead, with threshold_v, or with k11_pn and both permittivities");
    visit.number("threshold_v", self.threshold_v, numbers::positive(1e4, "V").left_out(), "of the untwisted cell");
    visit.number("k33_over_k11", self.k33_over_k11, numbers::positive(20).left_out().known_within_share(0.05),
                 "bend over splay constant");
    visit.number("k22_over_k11", self.k22_over_k11, numbers::positive(20).left_out().known_within_share(0.05),
                 "twist over splay constant; only with twist or pitch");
    visit.number("eps_ratio", self.eps_ratio, numbers::positive(100).left_out().known_within_share(0.02),
                 "eps_parallel / eps_perpendicular");
    visit.number("k11_pn", self.k11_pn, numbers::positive(1000, "pN").left_out().known_within_share(0.05),
                 "splay constant; the constants instead of their ratios");
    visit.number("k22_pn", self.k22_pn, numbers::positive(1000, "pN").left_out().known_within_share(0.05),
                 "twist constant; only with twist or pitch");
    visit.number("k33_pn", self.k33_pn, numbers::positive(1000, "pN").left_out().known_within_share(0.05),
                 "bend constant");
    visit.number("eps_parallel", self.eps_parallel, numbers::positive(1000).left_out(),
                 "permittivity along the axis, instead of eps_ratio");
    visit.number("eps_perpendicular", self.eps_perpendicular, numbers::positive(1000).left_out(),
                 "permittivity across the axis");
    visit.number("pretilt_deg", self.pretilt_deg, numbers::angle(0, 45).physical().or_else(1),
                 "at both faces; of hybrid cells 0 where it is not given");
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial().or_else(0), "at the entry face");
    visit.number("twist_deg", self.twist_deg, numbers::angle(-1440, 1440).left_out(),
                 "between the faces, > 0 right-handed; not given: none");
    visit.number("pitch_um", self.pitch_um, numbers::within(-100000, 100000, "um").left_out(),
                 "of the unstrained chiral nematic, > 0 right-handed; not given: none");
  }
};

/// Cholesteric helix along the normal: azimuth(z) = azimuth_deg + 360 degrees z / pitch, no tilt. With a modulus k in
/// [0, 1) the helix is partly unwound by a field in the layer plane along azimuth_deg + 90 degrees (de Gennes & Prost,
/// The Physics of Liquid Crystals, 6.2.2): azimuth = azimuth_deg + am(pi^2 z / (pitch E(k)) | k), field / critical
/// field = k / E(k).
struct HelixDirector {
  static constexpr const char* kKey = "helix";
  ParameterRef pitch_um, azimuth_deg, modulus;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("pitch_um", self.pitch_um, numbers::within(-100000, 100000, "um"), "without field; > 0 right-handed");
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial().or_else(0), "at the entry face");
    visit.number("modulus", self.modulus, numbers::within(0, 1 - 1e-6).physical().left_out(),
                 "k of a helix that a field unwinds; not given: no field");
  }
};

/// Radial hedgehog, n = r/|r|; with twist_deg != 0 the radial field turned about the optical axis by
/// twist_deg (1 - r/R): homeotropic at the surface, twisted inside (no equilibrium, a fully coupled test scene).
struct RadialDirector {
  static constexpr const char* kKey = "radial";
  static constexpr bool kMayBeEmpty = true;  // as a key with nothing behind it
  ParameterRef twist_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("twist_deg", self.twist_deg, numbers::angle().left_out(),
                 "twist (1 - r/R) about the optical axis; not given: none, diagonal transport");
  }
};

/// Normal anchoring, an electric field along the viewing axis or in the image plane, positive dielectric anisotropy,
/// one elastic constant (Humar et al., Opt. Express 17, 2009): a point hedgehog that a field turns into a wall across
/// the equator, or, with ring_radius, an equatorial disclination ring. An image tells one number: e = radius /
/// coherence length, the coherence length being sqrt(K / (eps0 deps)) / local field. Given as it is, or as
/// field_v_per_um with what makes e of it: e = (diameter / 2) local_field_factor field_v_per_um / coherence_voltage_v.
struct AxialDirector {
  static constexpr const char* kKey = "axial";
  ParameterRef reduced_field, field_v_per_um, coherence_voltage_v, local_field_factor, ring_radius, field_azimuth_deg;
  bool compare = false;  ///< a fit tries the hedgehog, too (FitJob::branches)

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("reduced_field", self.reduced_field, numbers::within(0, 60).physical().left_out(),
                 "e, radius over coherence length; or field_v_per_um with the two numbers that reduce it");
    visit.number("field_v_per_um", self.field_v_per_um, numbers::within(0, 100, "V/um").physical().left_out(),
                 "applied field, rms");
    visit.number("coherence_voltage_v", self.coherence_voltage_v, numbers::positive(10, "V").left_out(),
                 "sqrt(K / (eps0 deps)): 0.27 V for 5CB, 0.34 V for E7");
    visit.number("local_field_factor", self.local_field_factor, numbers::within(0.01, 3).left_out(),
                 "field in the droplet over applied field");
    visit.number("ring_radius", self.ring_radius, numbers::within(0.2, 0.995).left_out(),
                 "of an equatorial disclination ring over the radius; not given: hedgehog");
    visit.number("field_azimuth_deg", self.field_azimuth_deg, numbers::dial().left_out(),
                 "field in the image plane, from +x; not given: along the view");
  }
};

/// Tangential anchoring: the director follows the circles through two poles (Williams, J. Phys. A 19, 3211 (1986)).
struct BipolarDirector {
  static constexpr const char* kKey = "bipolar";
  static constexpr bool kMayBeEmpty = true;  // as a key with nothing behind it
  ParameterRef azimuth_deg, tilt_deg, pole_distance;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial().or_else(0), "of the poles' axis, from +x");
    visit.number("tilt_deg", self.tilt_deg, numbers::angle(-90, 90).or_else(0),
                 "of that axis out of the image plane, towards +z");
    visit.number("pole_distance", self.pole_distance, numbers::within(1, 1000).or_else(1),
                 "of the poles from the centre, in radii: 1 on the surface, large uniform");
  }
};

/// Liquid crystal between a sphere and an isotropic core, normal anchoring at both: radial where the core is in the
/// middle, the normals of nested spheres otherwise. Straight rays are not refracted at the core, curved ones and waves
/// are.
struct ShellDirector {
  ParameterRef wall_um;
  std::array<ParameterRef, 3> offset_um = {};  ///< all or none
  ParameterRef core_index;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("wall_um", self.wall_um, numbers::length_um(5000), "difference of the two radii");
    visit.vector("core_offset_um", self.offset_um, numbers::within(-5000, 5000, "um").left_out(),
                 "of the core's centre, [x, y, z]; the sign of z is not observable");
    visit.number("core.index", self.core_index, numbers::index().left_out(),
                 "not given: the surround's. Of straight rays it only judges what refraction at the core would change");
  }
};

/// The families that a droplet may have.
using DropletDirector = std::variant<RadialDirector, AxialDirector, BipolarDirector, ShellDirector>;
/// The families that a cell may have.
using CellDirector = std::variant<UniformDirector, TwistedDirector, FreederickszDirector, HelixDirector>;

}  // namespace birefit
