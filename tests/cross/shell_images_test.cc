// The peers' voxel images of a radial shell: 30 um across, wall 3 um, 1.534/1.707 in 1.42 inside and out, box 38.4
// x 38.4 x 32 um in 160 slices, 590 nm, straight unrefracted rays. There is one number of slices only, so convergence
// is shown by a second computation of the same voxels.

#include <gtest/gtest.h>

#include <array>
#include <complex>
#include <cstdio>

#include "birefit/render.h"
#include "medium/families/radial.h"
#include "profiles.h"
#include "reference_table.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSize = 128;
constexpr double kBox = 38.4, kDepth = 32, kOuter = 15, kInner = 12, kOrdinary = 1.534, kExtraordinary = 1.707,
                 kHost = 1.42, kWavenumber = 2 * std::numbers::pi / 0.59;

/// What a peer's mode keeps of a column of voxels.
enum class Faces { none, forward, all };

double between_crossed(std::complex<double> o, std::complex<double> e, double x, double y, bool at_45) {
  const double twice = 2 * std::atan2(y, x), turn = at_45 ? std::cos(twice) : std::sin(twice);
  return 0.25 * std::norm(e - o) * turn * turn;
}

/// Written from the definition: slices whose indices are those of their middles. The director lies in the plane of ray
/// and radius, so that o and e each run through a stack of isotropic layers: by its phase; with Fresnel's transmission
/// at each face; or by characteristic matrices, which hold all reflections (Born & Wolf 1.6.2).
double voxel_intensity(double x, double y, int slices, Faces faces, bool at_45) {
  using C = std::complex<double>;
  const double b2 = x * x + y * y, step = kDepth / slices;
  C transmitted[2];
  for (const bool e : {false, true}) {
    double phase = 0, amplitude = 1, before = kHost;
    std::array<C, 4> m{1, 0, 0, 1};
    for (int k = 0; k < slices; ++k) {
      const double z = (k + 0.5) * step - 0.5 * kDepth, r2 = b2 + z * z, across = b2 / r2;
      double n = kHost;
      if (r2 < kOuter * kOuter && r2 > kInner * kInner)
        n = e ? 1 / std::sqrt((1 - across) / (kOrdinary * kOrdinary) + across / (kExtraordinary * kExtraordinary))
              : kOrdinary;
      const double thick = kWavenumber * n * step;
      phase += thick;
      amplitude *= 2 * std::sqrt(before * n) / (before + n);
      before = n;
      if (faces != Faces::all) continue;
      const C c = std::cos(thick), s(0, -std::sin(thick));
      m = {m[0] * c + m[1] * s * n, m[0] * s / n + m[1] * c, m[2] * c + m[3] * s * n, m[2] * s / n + m[3] * c};
    }
    amplitude *= 2 * std::sqrt(before * kHost) / (before + kHost);
    transmitted[e] = faces == Faces::all ? 2 * kHost / ((m[0] + m[1] * kHost) * kHost + m[2] + m[3] * kHost)
                                         : std::polar(faces == Faces::none ? 1 : amplitude, phase);
  }
  return between_crossed(transmitted[0], transmitted[1], x, y, at_45);
}

/// birefit's phase of a radial medium along a straight chord, the ball of the core taken out.
double closed_intensity(double x, double y, bool at_45) {
  const double b = std::hypot(x, y);
  const auto ball = [&](double radius) {
    LawColumn<double, RadialLaw<double>> column(
        RadialLaw<double>{Chord<double>(b, std::sqrt(radius * radius - b * b), radius), kOrdinary * kOrdinary,
                          kExtraordinary * kExtraordinary});
    column.planar = true;
    const Su2<double> of =
        Diagonal<double>().retarder(column, {kWavenumber, 0, 0, Continuity::e_and_h}, uniform_mesh(48));
    return std::complex<double>(of.w, of.z);  // e^{i phase/2} of the e wave
  };
  if (b >= kOuter) return 0;
  std::complex<double> e = ball(kOuter);
  if (b < kInner) e *= std::conj(ball(kInner));
  return between_crossed(std::conj(e), e, x, y, at_45);
}

struct Distance {
  double rms, worst;  ///< rms: relative to that of the second
};
template <class A, class B>
Distance distance(const A& a, const B& b) {
  double sum = 0, size = 0, worst = 0;
  for (int r = 0; r < kSize; ++r)
    for (int c = 0; c < kSize; ++c) {
      const double x = (c - (kSize - 1) / 2.0) * kBox / kSize, y = ((kSize - 1) / 2.0 - r) * kBox / kSize,
                   to = b(c, r, x, y), off = a(c, r, x, y) - to;
      sum += off * off;
      size += to * to;
      worst = std::max(worst, std::abs(off));
    }
  return {std::sqrt(sum / size), worst};
}

auto voxels(int slices, Faces faces, bool at_45) {
  return [=](int, int, double x, double y) { return voxel_intensity(x, y, slices, faces, at_45); };
}
auto closed(bool at_45) {
  return [=](int, int, double x, double y) { return closed_intensity(x, y, at_45); };
}
std::string file_of(const char* mode, bool at_45) {
  return std::string("peers/images/shell_n142_") + mode + "_nz160_raw_I" + (at_45 ? "45" : "0") + ".pfm";
}

// Three of their modes, two polarizers each: the same voxels to the last bit of their 32.
TEST(PeerShell, ImagesAreThoseOfTheirVoxels) {
  for (const auto& [mode, faces] :
       {std::pair{"jones", Faces::none}, {"tmm2x2_1", Faces::forward}, {"tmm4x4", Faces::all}})
    for (const bool at_45 : {false, true}) {
      const Image image = read_pfm(data_path(file_of(mode, at_45)));
      ASSERT_EQ(image.width(), kSize);
      const Distance d = distance(voxels(160, faces, at_45), [&](int c, int r, double, double) { return image(c, r); });
      EXPECT_LT(d.worst, 6e-8) << mode << at_45;  // one unit of the last place below 1
    }
}

// Their 0.2 um slices are 0.09 from the closed form: a wall that begins or ends half a slice off at four places shifts
// the phase by up to k0 (n_e - n_o) 0.2 um = 0.37 rad. Slices a quarter as thick err by a quarter, and so on.
TEST(PeerShell, VoxelsApproachTheClosedFormAtFirstOrder) {
  for (const bool at_45 : {false, true}) {
    const Image image = read_pfm(data_path(file_of("jones", at_45)));
    const double theirs = distance([&](int c, int r, double, double) { return image(c, r); }, closed(at_45)).rms;
    const double finer = distance(voxels(640, Faces::none, at_45), closed(at_45)).rms,
                 finest = distance(voxels(2560, Faces::none, at_45), closed(at_45)).rms;
    std::printf("  I%d: 160 slices %.4f, 640 %.4f, 2560 %.4f from the closed form\n", at_45 ? 45 : 0, theirs, finer,
                finest);
    EXPECT_NEAR(theirs, 0.09, 0.005);
    EXPECT_NEAR(theirs / finer, 4, 0.5);
    EXPECT_NEAR(finer / finest, 4, 0.5);
  }
}

// What straight rays leave out of this picture is refraction first: rays bent at the outer sphere are nearer to waves,
// though light is taken straight through the core. What remains is the core's refraction and diffraction.
TEST(PeerShell, BendingRaysAtTheSphereGoesTowardsWaves) {
  TableBuilder b;
  Scene scene;
  Droplet shell;
  shell.diameter_um = b.fixed("diameter_um", 2 * kOuter);
  ShellDirector wall;
  wall.wall_um = b.fixed("wall_um", kOuter - kInner);
  wall.core_index = b.fixed("core_index", kHost);
  shell.director = wall;
  scene.sample = shell;
  scene.material =
      ConstantIndices{b.fixed("ordinary", kOrdinary), b.fixed("birefringence", kExtraordinary - kOrdinary)};
  scene.surround_index = b.fixed("index", kHost);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
  scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 45);
  scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 135);
  scene.microscope.objective_na = b.fixed("objective_na", 0.8);
  scene.view.width = scene.view.height = kSize;
  scene.view.pixel_size_um = b.fixed("pixel_size_um", kBox / kSize);
  scene.view.center_x_px = scene.view.center_y_px = b.fixed("center", 0.5 * (kSize - 1));
  const Theta theta = b.table.values();
  const Image bent = render(scene, plan(scene, theta), theta, {}, 1).intensity,
              wave = render(scene, plan(scene, {.ceiling = Ceiling::wave}, theta), theta, {}, 1).intensity,
              peer = read_pfm(data_path(file_of("jones", true)));
  const auto pixels = [](const Image& image) { return [&image](int c, int r, double, double) { return image(c, r); }; };
  const double straight_off = distance(pixels(peer), pixels(wave)).rms,
               bent_off = distance(pixels(bent), pixels(wave)).rms;
  std::printf(
      "  relative RMS from waves: straight voxels %.3f, rays bent at the outer sphere %.3f; the two from each other "
      "%.3f\n",
      straight_off, bent_off, distance(pixels(bent), pixels(peer)).rms);
  EXPECT_GT(straight_off, 0.5);  // voxels explain 0.09 of it
  EXPECT_LT(bent_off, 0.7 * straight_off);
}

}  // namespace
}  // namespace birefit
