// Derivatives: kernels against ceres::Jet, whole images against Richardson differences.

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "birefit/render.h"
#include "birefit/volume.h"
#include "medium/families/planar.h"
#include "medium/families/radial.h"
#include "samples/choices.h"
#include "scene/polariscope.h"
#include "scene_builder.h"
#include "transport/one_way.h"

// What the kernels ask of a scalar beyond arithmetic, for the oracle: found by argument-dependent look-up.
namespace ceres {
inline double plain(const Jet<double, 3>& x) { return x.a; }
}  // namespace ceres

namespace birefit {
namespace {
using Jet = ceres::Jet<double, 3>;
using D3 = Dual<double, 3>;

/// Largest difference of value and derivatives, relative to the largest derivative of the pair.
void expect_same(const Jet& jet, const D3& dual, double phase_rad, const std::string& what) {
  double size = std::abs(jet.a);
  for (int i = 0; i < 3; ++i) size = std::max(size, std::abs(jet.v[i]));
  const double tolerance = 1e-12 * (1 + phase_rad / 100) * std::max(size, 1e-3);
  EXPECT_NEAR(jet.a, dual.value, tolerance) << what;
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(jet.v[i], dual.d[static_cast<std::size_t>(i)], tolerance) << what << " d" << i;
}

template <class S>
S variable(double value, int index);
template <>
Jet variable<Jet>(double value, int index) {
  return Jet(value, index);
}
template <>
D3 variable<D3>(double value, int index) {
  D3 x(value);
  x.d[static_cast<std::size_t>(index)] = 1;
  return x;
}

/// The pieces of a step: where, which axis, which generator, as functions of three parameters.
template <class S>
std::array<S, 6> radial_sample(double u, bool twisted) {
  const S radius = variable<S>(4.65, 0), impact = variable<S>(1.3, 1), n_e = variable<S>(1.74, 2);
  const S half = sqrt(radius * radius - impact * impact);
  const Chord<S> chord(impact, half, radius);
  const S eo(1.52 * 1.52), ee = n_e * n_e;
  const OpticalPoint<S> p =
      twisted ? TwistedRadialLaw<S>{chord, S(0.1), S(std::sqrt(0.99)), impact * S(0.4), eo, ee}.at(S(u))
              : RadialLaw<S>{chord, eo, ee}.at(S(u));
  const Vec3<S> v = su2_generator(p, S(10.6));
  return {p.axis.x, p.axis.y, p.axis.z, p.depth_slope_um, v.x, v.z};
}

TEST(Gradients, RadialAndTwistedRadialLawsAgreeWithJets) {
  for (bool twisted : {false, true})
    for (double u : {1e-8, 0.13, 0.41, 0.77, 0.999}) {
      const auto jets = radial_sample<Jet>(u, twisted);
      const auto duals = radial_sample<D3>(u, twisted);
      for (std::size_t i = 0; i < 6; ++i)
        expect_same(jets[i], duals[i], 20,
                    (twisted ? "twisted " : "radial ") + std::to_string(i) + " u " + std::to_string(u));
    }
}

template <class S>
std::array<S, 8> oblique_operator(double kx, double ky) {
  const S azimuth = variable<S>(0.4, 0), tilt = variable<S>(0.5, 1), n_e = variable<S>(1.74, 2);
  const OpticalPoint<S> p = TwistedLaw<S>{azimuth, S(1.2), tilt, S(1.52 * 1.52), n_e * n_e, S(5.0)}.at(S(0.3));
  const auto m = one_way(p, S(kx), S(ky));
  return {m.index.a.re,      m.index.b.re,      m.index.c.re,      m.index.d.re,
          m.admittance.a.re, m.admittance.b.re, m.admittance.c.re, m.admittance.d.re};
}

TEST(Gradients, ObliqueOperatorAgreesWithJets) {
  for (const auto& [kx, ky] : {std::pair{0.0, 0.0}, {1e-8, 0.0}, {0.37, -0.21}}) {
    const auto jets = oblique_operator<Jet>(kx, ky);
    const auto duals = oblique_operator<D3>(kx, ky);
    for (std::size_t i = 0; i < 8; ++i) expect_same(jets[i], duals[i], 0, "entry " + std::to_string(i));
  }
}

TEST(Gradients, StepExponentialAgreesWithJetsThroughZero) {
  for (double size : {0.0, 1e-8, 1e-3, 0.17, 1.9, 40.0}) {
    // exp(i v.s), v = size (a, b, c); the oracle differentiates cos and sin of the modulus itself.
    const D3 a = variable<D3>(0.6, 0), b = variable<D3>(-0.3, 1), c = variable<D3>(0.74, 2);
    const Su2<D3> dual = su2_exp(Vec3<D3>{size * a, size * b, size * c});
    const Jet ja(0.6, 0), jb(-0.3, 1), jc(0.74, 2);
    const Jet modulus = sqrt(ja * ja + jb * jb + jc * jc);
    const Jet cosine = cos(size * modulus), sine = sin(size * modulus) / modulus;
    expect_same(cosine, dual.w, size, "w at " + std::to_string(size));
    expect_same(sine * ja, dual.x, size, "x at " + std::to_string(size));
    expect_same(sine * jc, dual.z, size, "z at " + std::to_string(size));
  }
}

// ---- whole images --------------------------------------------------------------------------------------------------

struct Case {
  std::string name;
  testing::TableBuilder t;
  Scene scene;
  Demand demand;
  std::vector<int> parameters;
  Observable observable = {};
};

Case base(const std::string& name) {
  Case c;
  c.name = name;
  c.scene.microscope.wavelength_nm = c.t.fixed("wavelength_nm", 590);
  c.scene.microscope.polarizer_deg = c.t.fixed("polarizer_deg", 12);
  c.scene.microscope.analyzer_deg = c.t.fixed("analyzer_deg", 95);
  c.scene.surround_index = c.t.fixed("index", 1.43);
  ConstantIndices m;
  m.ordinary = c.t.fixed("ordinary", 1.52);
  m.birefringence = c.t.fixed("birefringence", 0.2);
  c.scene.material = m;
  c.scene.view.width = c.scene.view.height = 16;
  c.scene.view.pixel_size_um = c.t.fixed("pixel_size_um", 0.5);
  c.scene.view.center_x_px = c.t.fixed("center_x", 7.7);
  c.scene.view.center_y_px = c.t.fixed("center_y", 7.4);
  c.scene.view.rotation_deg = c.t.fixed("rotation_deg", 3);
  return c;
}

std::vector<Case> cases() {
  std::vector<Case> all;
  for (bool twisted : {false, true}) {
    // Larger than the picture: the rim, where intensity ends like a root and differences fail, is outside.
    Case c = base(twisted ? "twisted droplet" : "droplet");
    Droplet d;
    d.diameter_um = c.t.fixed("diameter_um", 16);
    if (twisted) d.director = RadialDirector{c.t.fixed("twist_deg", 40)};
    c.scene.sample = d;
    all.push_back(c);
  }
  for (bool ring : {false, true}) {
    Case c = base(ring ? "droplet in a field, ring" : "droplet in a field, hedgehog");
    Droplet d;
    d.diameter_um = c.t.fixed("diameter_um", 16);
    AxialDirector axial;
    axial.field_v_per_um = c.t.fixed("field_v_per_um", 1.1);
    axial.coherence_voltage_v = c.t.fixed("coherence_voltage_v", 0.3);
    axial.local_field_factor = c.t.fixed("local_field_factor", 0.4);
    if (ring) axial.ring_radius = c.t.fixed("ring_radius", 0.93);
    d.director = axial;
    c.scene.sample = d;
    all.push_back(c);
  }
  for (int kind = 0; kind < 4; ++kind) {
    Case c = base(std::array{"bipolar droplet", "droplet in a field in the image plane", "shell",
                             "eccentric shell"}[static_cast<std::size_t>(kind)]);
    Droplet d;
    d.diameter_um = c.t.fixed("diameter_um", 16);
    if (kind == 0)
      d.director =
          BipolarDirector{c.t.fixed("azimuth_deg", 20), c.t.fixed("tilt_deg", 30), c.t.fixed("pole_distance", 1.2)};
    if (kind == 1) {
      AxialDirector axial;
      axial.reduced_field = c.t.fixed("reduced_field", 7);
      axial.field_azimuth_deg = c.t.fixed("field_azimuth_deg", 33);
      d.director = axial;
    }
    if (kind >= 2) {
      ShellDirector shell;
      shell.wall_um = c.t.fixed("wall_um", 1.43);
      // The core's edge, where the derivative of the square root is infinite, is beyond the picture.
      if (kind == 3)
        shell.offset_um = {c.t.fixed("offset_x", 0.3), c.t.fixed("offset_y", -0.2), c.t.fixed("offset_z", 0.25)};
      d.director = shell;
    }
    c.scene.sample = d;
    all.push_back(c);
  }
  {
    Case c = base("uniform cell");
    Cell cell;
    cell.thickness_um = c.t.fixed("thickness_um", 5);
    UniformDirector u;
    u.azimuth_deg = c.t.fixed("azimuth_deg", 30);
    u.tilt_deg = c.t.fixed("tilt_deg", 10);
    cell.director = u;
    c.scene.sample = cell;
    all.push_back(c);
  }
  {
    Case c = base("twisted cell");
    Cell cell;
    cell.thickness_um = c.t.fixed("thickness_um", 5);
    TwistedDirector u;
    u.azimuth_deg = c.t.fixed("azimuth_deg", 30);
    u.twist_deg = c.t.fixed("twist_deg", 80);
    u.pretilt_deg = c.t.fixed("pretilt_deg", 3);
    cell.director = u;
    c.scene.sample = cell;
    all.push_back(c);
  }
  using Anchoring = FreederickszDirector::Anchoring;
  const auto field_cell = [&](const std::string& name, Anchoring anchoring, double eps_ratio, double voltage) {
    Case c = base(name);
    Cell cell;
    cell.thickness_um = c.t.fixed("thickness_um", 5);
    FreederickszDirector d;
    d.anchoring = anchoring;
    d.reduced_voltage = c.t.fixed("reduced_voltage", voltage);
    d.k33_over_k11 = c.t.fixed("k33_over_k11", 1.5);
    d.eps_ratio = c.t.fixed("eps_ratio", eps_ratio);
    d.pretilt_deg = c.t.fixed("pretilt_deg", 2);
    d.azimuth_deg = c.t.fixed("azimuth_deg", 30);
    cell.director = d;
    c.scene.sample = cell;
    return c;
  };
  const auto field_of = [](Case& c) -> FreederickszDirector& {
    return std::get<FreederickszDirector>(std::get<Cell>(c.scene.sample).director);
  };
  all.push_back(field_cell("planar cell below its threshold", Anchoring::planar, 3.7, 0.9));
  all.push_back(field_cell("planar cell above its threshold", Anchoring::planar, 3.7, 1.05));
  all.push_back(field_cell("homeotropic cell", Anchoring::homeotropic, 0.5, 1.3));
  all.push_back(field_cell("hybrid cell", Anchoring::hybrid, 2, 0.7));
  {
    Case c = field_cell("twisted cell in a field", Anchoring::planar, 3.7, 1.4);
    field_of(c).k22_over_k11 = c.t.fixed("k22_over_k11", 0.6);
    field_of(c).twist_deg = c.t.fixed("twist_deg", 80);
    field_of(c).pitch_um = c.t.fixed("pitch_um", 60);
    all.push_back(c);
  }
  {
    Case c = field_cell("cell in volts, elastic constants in pN, behind a compensator", Anchoring::planar, 1, 0);
    FreederickszDirector& d = field_of(c);
    d.reduced_voltage = d.k33_over_k11 = d.eps_ratio = {};
    d.voltage_v = c.t.fixed("voltage_v", 1.3);
    d.k11_pn = c.t.fixed("k11_pn", 11.1);
    d.k33_pn = c.t.fixed("k33_pn", 17.1);
    d.eps_parallel = c.t.fixed("eps_parallel", 19.3);
    d.eps_perpendicular = c.t.fixed("eps_perpendicular", 5.2);
    Retarder compensator;
    compensator.phase_deg = c.t.fixed("compensator_phase_deg", 70);
    compensator.azimuth_deg = c.t.fixed("compensator_azimuth_deg", 25);
    c.scene.microscope.behind.emplace_back(compensator);
    ConstantIndices& m = std::get<ConstantIndices>(c.scene.material);
    m.resonance_nm = c.t.fixed("resonance_nm", 250);
    all.push_back(c);
  }
  for (const auto structure : {FormIndices::Structure::layers, FormIndices::Structure::rods}) {
    Case c = base("film of layers or rods far smaller than a wavelength");
    Cell film;
    film.thickness_um = c.t.fixed("thickness_um", 7);
    UniformDirector director;
    director.tilt_deg = c.t.fixed("tilt_deg", 20), director.azimuth_deg = c.t.fixed("azimuth_deg", 35);
    film.director = director;
    c.scene.sample = film;
    c.scene.material =
        FormIndices{structure, c.t.fixed("fraction", 0.4), c.t.fixed("inside", 1.7), c.t.fixed("between", 1.33)};
    all.push_back(c);
  }
  {
    Case c = base("unwound helix");
    Cell cell;
    cell.thickness_um = c.t.fixed("thickness_um", 5);
    HelixDirector helix;
    helix.pitch_um = c.t.fixed("pitch_um", 4);
    helix.azimuth_deg = c.t.fixed("azimuth_deg", 20);
    helix.modulus = c.t.fixed("modulus", 0.9);
    cell.director = helix;
    c.scene.sample = cell;
    all.push_back(c);
  }
  {
    Case c = base("heated plate");
    Plate plate;
    plate.thickness_um = c.t.fixed("thickness_um", 60);
    for (int i = 0; i < 3; ++i)
      plate.director.axis[static_cast<std::size_t>(i)] =
          c.t.fixed("axis" + std::to_string(i), std::array{-0.35, 0.35, -0.87}[static_cast<std::size_t>(i)]);
    HeatStep heat;
    heat.fourier_number = c.t.fixed("fourier_number", 0.07);
    heat.cold_k = c.t.fixed("cold_k", 278);
    heat.hot_k = c.t.fixed("hot_k", 368);
    plate.heat = heat;
    plate.half_angle_deg = c.t.fixed("half_angle_deg", 15);
    c.scene.sample = plate;
    c.scene.material = E44Steinberg2020{};
    all.push_back(c);
    Case side = c;
    side.name = "heated plate, its screen seen from the side";
    side.scene.view.camera =
        SideCamera{side.t.fixed("tilt_x_deg", 30), side.t.fixed("tilt_y_deg", -15), side.t.fixed("half_field_deg", 25)};
    all.push_back(side);
    side.name = "heated plate, seen from in front by a camera that may move";
    for (const char* tilt : {"tilt_x_deg", "tilt_y_deg"}) side.t.table[side.t.table.find(tilt)].value = 0;
    all.push_back(side);
    c.name = "plate heated from both sides";
    heat.fourier_number = {};
    heat.time_s = c.t.fixed("time_s", 0.0025);
    heat.diffusivity_mm2_s = c.t.fixed("diffusivity_mm2_s", 0.1);
    heat.initial_k = c.t.fixed("initial_k", 290);
    std::get<Plate>(c.scene.sample).heat = heat;
    all.push_back(c);
  }
  {
    Case c = base("absorbing slab in a cone");
    Slab slab;
    slab.profile.interpolation = SlabProfile::Interpolation::cubic;
    for (int i = 0; i < 6; ++i) {
      const double u = i / 5.0;
      slab.profile.rows.push_back({250 * u, std::cos(0.3 + 0.5 * u), std::sin(0.3 + 0.5 * u), 0.4 + 0.2 * u, 1.52,
                                   1.7 + 0.02 * u, 0, 2e-4 * u});
    }
    slab.half_angle_deg = c.t.fixed("half_angle_deg", 2);
    c.scene.sample = slab;
    all.push_back(c);
  }
  {
    Case c = base("crystal");
    Crystal crystal;
    crystal.half_wave_voltage_v = c.t.fixed("half_wave_voltage_v", 1500);
    crystal.bias_v = c.t.fixed("bias_v", 700);
    crystal.slow_axis_deg = c.t.fixed("slow_axis_deg", 52);
    crystal.field_legendre = {c.t.fixed("c1", 0.2), c.t.fixed("c2", -0.1), c.t.fixed("c3", 0.05)};
    c.scene.sample = crystal;
    all.push_back(c);
  }
  {
    // Every number of the laws of materials: wavelength (in the indices too), temperature, clearing point,
    // coefficients.
    Case c = base("nematic droplet in a liquid of known dispersion");
    Droplet d;
    d.diameter_um = c.t.fixed("diameter_um", 16);
    c.scene.sample = d;
    const auto law = [&](const std::string& name, Dispersion::Form form, std::vector<double> coefficients,
                         std::vector<int> fitted) {
      Dispersion r;
      r.form = form;
      r.coefficients = coefficients;
      r.refs.resize(coefficients.size());
      for (int i : fitted)
        r.refs[static_cast<std::size_t>(i)] =
            c.t.fixed(name + std::to_string(i), coefficients[static_cast<std::size_t>(i)]);
      r.lower_um = 0.4;
      r.upper_um = 0.8;
      return r;
    };
    LawIndices m;
    m.indices =
        DispersiveIndices{law("cauchy", Dispersion::Form::cauchy, {1.5139, 0.0052, -2, 0.0008, -4.5}, {0, 1, 3}),
                          law("sellmeier", Dispersion::Form::sellmeier_2, {0, 1.83, 0.018}, {1, 2})};
    m.haller = HallerLaw{c.t.fixed("reference_k", 298), c.t.fixed("clearing_k", 309), c.t.fixed("exponent", 0.17),
                         c.t.fixed("slope", 2e-4)};
    m.temperature_k = c.t.fixed("temperature_k", 304);
    m.birefringence_factor = c.t.fixed("factor", 1.05);
    c.scene.material = m;
    Dispersion table;
    table.form = Dispersion::Form::table;
    table.wavelength_um = {0.4, 0.55, 0.62, 0.8};
    table.index = {1.47, 1.44, 1.433, 1.42};
    table.lower_um = 0.4;
    table.upper_um = 0.8;
    c.scene.surround_dispersion = table;
    all.push_back(c);
  }
  {
    Case c = base("heated nematic plate");
    Plate plate;
    plate.thickness_um = c.t.fixed("thickness_um", 60);
    plate.director.azimuth_deg = c.t.fixed("azimuth_deg", 40);
    plate.director.tilt_deg = c.t.fixed("tilt_deg", 35);
    HeatStep heat;
    heat.fourier_number = c.t.fixed("fourier_number", 0.07), heat.cold_k = c.t.fixed("cold_k", 290),
    heat.hot_k = c.t.fixed("hot_k", 304);
    plate.heat = heat;
    plate.half_angle_deg = c.t.fixed("half_angle_deg", 15);
    c.scene.sample = plate;
    LawIndices m;
    FourParameterIndices four;
    for (const auto& [um, a, b, dn, e, k] : {std::tuple{0.589, 1.6327, 1.347e-4, 0.3261, 0.1645, 308.74},
                                             {0.633, 1.6238, 1.204e-4, 0.3185, 0.1650, 308.77}}) {
      const std::string name = "set" + std::to_string(um);
      four.sets.push_back({um, c.t.fixed(name + "a", a), c.t.fixed(name + "b", b), c.t.fixed(name + "dn", dn),
                           c.t.fixed(name + "e", e), c.t.fixed(name + "k", k)});
    }
    m.indices = four;
    m.birefringence_factor = c.t.fixed("factor", 0.95);
    c.scene.material = m;
    c.t.table[c.scene.microscope.wavelength_nm].value = 610;
    all.push_back(c);
  }
  for (bool circular : {false, true}) {
    Case c = base(circular ? "disc, circular polariscope" : "disc, plane polariscope");
    StressedDisc disc;
    disc.diameter_um = c.t.fixed("diameter_um", 40);  // larger than the picture: no edge in it
    disc.thickness_um = c.t.fixed("thickness_um", 5000);
    disc.load_n = c.t.fixed("load_n", 0.4);
    disc.stress_optic_brewster = c.t.fixed("stress_optic_brewster", 30);
    disc.load_azimuth_deg = c.t.fixed("load_azimuth_deg", 70);
    disc.residual_normal_mpa = {c.t.fixed("n1", 0.5), c.t.fixed("nx", 0.4), c.t.fixed("ny", -0.3)};
    disc.residual_shear_mpa = {c.t.fixed("s1", -0.2), c.t.fixed("sx", 0.1), c.t.fixed("sy", 0.3),
                               c.t.fixed("sxx", 0.6)};
    c.scene.sample = disc;
    if (circular) make_circular_polariscope(c.scene.microscope, c.t.fixing());
    all.push_back(c);
    c.name += ", broad and uneven light";
    disc.illumination = {c.t.fixed("light_x", 0.4), c.t.fixed("light_y", -0.2), c.t.fixed("light_xx", 0.3)};
    c.scene.sample = disc;
    c.scene.microscope.bandwidth_nm = c.t.fixed("bandwidth_nm", 60);
    all.push_back(c);
  }
  for (const std::string name : {"sampled field", "sampled field, E alone", "waves: sampled field"}) {
    Case c = base(name);
    const bool waves = name.starts_with("waves");
    // One cell across, larger than the picture (waves: smaller): no face, where trilinear interpolation has a kink, is
    // crossed by a difference.
    auto grid = std::make_shared<VolumeGrid>();
    grid->nx = grid->ny = 2, grid->nz = 6;
    grid->spacing_um = {14, 15, 0.8};
    if (waves) grid->spacing_um = {3.1, 2.7, 0.7};
    for (int i = 0; i < 24; ++i) {
      const double tilt = 0.4 * std::sin(1.1 * i), azimuth = 0.5 * std::cos(0.7 * i) + 0.04 * i,
                   s = 0.8 + 0.2 * std::sin(2.3 * i);
      grid->nodes.push_back(
          director_tensor(std::cos(tilt) * std::cos(azimuth), std::cos(tilt) * std::sin(azimuth), std::sin(tilt), s));
    }
    SampledVolume volume;
    volume.grid = grid;
    volume.scale = c.t.fixed("scale", 1.1);
    c.scene.sample = volume;
    if (name.ends_with("alone")) c.demand.ceiling = Ceiling::e_only;
    if (waves) {
      grid->nodes[9] = {};  // the host: a surface inside
      c.demand.ceiling = Ceiling::wave;
      c.scene.microscope.objective_na = c.t.fixed("objective_na", 0.6);
      c.scene.microscope.focus_um = c.t.fixed("focus_um", 0.7);
    }
    all.push_back(c);
  }
  // Wave optics: the exact series of a ball and of a shell, and propagation through what has none.
  for (const std::string name : {"waves: series", "waves: series of a shell", "waves: twisted", "waves: bipolar",
                                 "waves: hedgehog in a field", "waves: eccentric shell"}) {
    Case c = base(name);
    c.demand.ceiling = Ceiling::wave;
    c.scene.microscope.objective_na = c.t.fixed("objective_na", 0.6);
    c.scene.microscope.focus_um = c.t.fixed("focus_um", 0.7);
    c.scene.microscope.aplanatic = name == "waves: series of a shell" || name == "waves: bipolar";
    Droplet d;
    d.diameter_um = c.t.fixed("diameter_um", 5);
    if (name == "waves: twisted") d.director = RadialDirector{c.t.fixed("twist_deg", 40)};
    if (name == "waves: bipolar")
      d.director =
          BipolarDirector{c.t.fixed("azimuth_deg", 25), c.t.fixed("tilt_deg", 20), c.t.fixed("pole_distance", 1.2)};
    if (name == "waves: hedgehog in a field") {
      AxialDirector axial;
      axial.reduced_field = c.t.fixed("reduced_field", 6);
      d.director = axial;
    }
    if (name.ends_with("shell")) {
      ShellDirector shell;
      shell.wall_um = c.t.fixed("wall_um", 0.9);
      shell.core_index = c.t.fixed("core_index", 1.38);
      if (name == "waves: eccentric shell")
        shell.offset_um = {c.t.fixed("offset_x", 0.3), c.t.fixed("offset_y", -0.2), c.t.fixed("offset_z", 0.1)};
      d.director = shell;
    }
    c.scene.sample = d;
    all.push_back(c);
  }
  {
    Case c = base("ring radii on a screen");
    Plate plate;
    plate.thickness_um = c.t.fixed("thickness_um", 26000);
    plate.director.axis = {c.t.fixed("ax", 0), c.t.fixed("ay", 0), c.t.fixed("az", 1)};
    plate.screen_distance_um = c.t.fixed("screen_distance_um", 7e5);
    plate.ring_offset = c.t.fixed("ring_offset", -0.2);
    c.observable.quantity = Quantity::ring_radius_cm;
    for (int i = 0; i < c.scene.view.width; ++i) c.observable.ring_numbers.push_back(i + 1);
    c.scene.sample = plate;
    c.scene.view.height = 1;
    all.push_back(c);
  }
  return all;
}

// Richardson differences are good to about 1e-8 of the second derivative's size (steps this short, because a ring of
// defects puts a kink into the image that moves with its radius); 1e-6 of the largest entry is asked.
TEST(Gradients, EveryParameterOfEverySceneAgreesWithDifferences) {
  for (Case& c : cases()) {
    const Theta theta = c.t.table.values();
    RenderPlan p = plan(c.scene, c.demand, theta, c.observable);
    // Points that go from one part of a table to another jump by a little of the accuracy (PolarTable and RadialTable
    // look at that).
    choices(p).disc.clear();
    if (c.demand.ceiling != Ceiling::wave) choices(p).radial_panels = 0;
    std::vector<int> active;
    for (int i = 0; i < c.t.table.size(); ++i) active.push_back(i);
    const Rendering r = render(c.scene, p, theta, active, 1);
    bool any = false;
    for (std::size_t k = 0; k < active.size(); ++k) {
      const int i = active[k];
      // Surfaces of propagated spheres are ramps a third of a wavelength thick whose second derivative jumps:
      // differences must be short beside that.
      const double longest = (p.wave ? 1e-5 : 5e-5) * std::max(0.1, std::abs(theta[static_cast<std::size_t>(i)]));
      const auto at = [&](double step) {
        Theta moved = theta;
        moved[static_cast<std::size_t>(i)] += step;
        return render(c.scene, p, moved, {}, 1).intensity;
      };
      // A pixel is wrong by both steps or not at all: a kink near one of its points lies within the longer and not
      // within the shorter.
      std::vector<double> error(r.intensity.size(), std::numeric_limits<double>::infinity());
      for (const double h : {longest, longest / 4}) {
        const Image a = at(h), b = at(-h), a2 = at(h / 2), b2 = at(-h / 2);
        Image exact = a;
        double size = 0;
        for (std::size_t j = 0; j < a.size(); ++j) {
          const double coarse = (a.values()[j] - b.values()[j]) / (2 * h), fine = (a2.values()[j] - b2.values()[j]) / h;
          exact.values()[j] = (4 * fine - coarse) / 3;
          size = std::max(size, std::abs(exact.values()[j]));
        }
        // 1e-11/h: rounding of the differences.
        for (std::size_t j = 0; j < a.size(); ++j)
          error[j] = std::min(error[j],
                              std::abs(exact.values()[j] - r.derivatives[k].values()[j]) / (1e-6 * size + 1e-11 / h));
        any = any || size > 1e-6;
      }
      EXPECT_LT(*std::max_element(error.begin(), error.end()), 1) << c.name << ", " << c.t.table[i].name;
    }
    EXPECT_TRUE(any) << c.name << " depends on nothing";
  }
}

TEST(Gradients, SameBitsWhateverTheNumberOfThreads) {
  Case c = cases()[1];
  const Theta theta = c.t.table.values();
  const RenderPlan p = plan(c.scene, c.demand, theta, c.observable);
  const Rendering one = render(c.scene, p, theta, {0, 1, 3}, 1), two = render(c.scene, p, theta, {0, 1, 3}, 2);
  EXPECT_EQ(one.intensity.values(), two.intensity.values());
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(one.derivatives[k].values(), two.derivatives[k].values());
}

}  // namespace
}  // namespace birefit
