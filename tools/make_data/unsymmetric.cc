// Makes the images of data/bipolar_droplet and data/eccentric_shell: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/unsymmetric.cc -o make_unsymmetric && ./make_unsymmetric
//   for i in bipolar_droplet eccentric_shell; do oiiotool --nosoftwareattrib $i.pgm -o $i.png; done
// Brute force: every subpixel's ray refracts at the sphere (tests/support/independent_droplet.h has the geometry and
// its sources) and crosses 400 homogeneous retarders. Directors from their definitions: circles through two poles
// (Williams, J. Phys. A 19, 3211 (1986)), normals of nested spheres.

#include <array>
#include <complex>
#include <functional>

#include "independent_droplet.h"
#include "pgm.h"

namespace {

using Vec = std::array<double, 3>;
using Complex = std::complex<double>;
double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double length(const Vec& a) { return std::sqrt(dot(a, a)); }

struct Droplet {
  double diameter_um, n_o, n_e, n_host, wavelength_um;
  std::function<Vec(const Vec&)> director;  ///< at a place in radii
  Vec core{};                               ///< its middle in radii; no liquid crystal within
  double core_radius = 0;
};

/// 2 sqrt(Y1 Y2) / (Y1 + Y2)
double through(double y1, double y2) { return 2 * std::sqrt(y1 * y2) / (y1 + y2); }

/// Between polarizer 0 and analyser 90 degrees, at (x, y) um from the droplet's middle.
double light(const Droplet& d, double x, double y) {
  const double radius = d.diameter_um / 2, m = d.n_host / d.n_o, rho = std::hypot(x, y);
  const auto seen_at = [&](double b) { return b / std::cos(2 * (std::asin(b / radius) - std::asin(m * b / radius))); };
  double low = 0, high = radius * std::min(1.0, 1 / m) * (1 - 1e-12);
  if (rho <= 0 || rho >= seen_at(high)) return 0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (seen_at(middle) < rho ? low : high) = middle;
  }
  const double b = 0.5 * (low + high), h = 1e-6 * std::min(b, radius - b) + 1e-13,
               slope = (seen_at(b + h) - seen_at(b - h)) / (2 * h);
  const double outside = std::asin(b / radius), inside = std::asin(m * b / radius), turn = outside - inside,
               c = x / rho, s = y / rho;
  // The ray's frame inside: p in the plane of incidence, s across it, the ray itself.
  const Vec p{c * std::cos(turn), s * std::cos(turn), std::sin(turn)}, across{-s, c, 0},
      ray{-c * std::sin(turn), -s * std::sin(turn), std::cos(turn)};
  const Vec entry{b * c / radius, b * s / radius, -std::cos(outside)};
  const double chord = 2 * std::cos(inside);
  const auto place = [&](double share) {
    return Vec{entry[0] + share * chord * ray[0], entry[1] + share * chord * ray[1], entry[2] + share * chord * ray[2]};
  };
  // The ray's part in the core, in shares of the chord.
  double core_from = 2, core_to = 2;
  const Vec off{entry[0] - d.core[0], entry[1] - d.core[1], entry[2] - d.core[2]};
  const double nearest = -dot(off, ray), half2 = d.core_radius * d.core_radius - dot(off, off) + nearest * nearest;
  if (half2 > 0) core_from = (nearest - std::sqrt(half2)) / chord, core_to = (nearest + std::sqrt(half2)) / chord;
  constexpr int kLayers = 400;
  std::array<Complex, 4> jones{1, 0, 0, 1};
  const double k0 = 2 * M_PI / d.wavelength_um;
  const double crystal = core_from < 1 ? 1 - core_to + core_from : 1;
  for (int i = 0; i < kLayers; ++i) {
    const double through_crystal = (i + 0.5) / kLayers * crystal;
    // A layer that the core cuts in two is sampled in its middle, on one side of it: second order in its thickness.
    const Vec n =
        d.director(place(through_crystal < core_from ? through_crystal : through_crystal - core_from + core_to));
    const double np = dot(n, p), ns = dot(n, across), along = dot(n, ray), cos2 = along * along,
                 beside = np * np + ns * ns;
    if (beside < 1e-20) continue;
    const double delta = k0 * radius * chord * crystal / kLayers *
                         (1 / std::sqrt(cos2 / (d.n_o * d.n_o) + (1 - cos2) / (d.n_e * d.n_e)) - d.n_o);
    const double c2 = (np * np - ns * ns) / beside, s2 = 2 * np * ns / beside;
    const Complex a(std::cos(delta / 2), std::sin(delta / 2) * c2), cross(0, std::sin(delta / 2) * s2);
    jones = {a * jones[0] + cross * jones[2], a * jones[1] + cross * jones[3],
             cross * jones[0] + std::conj(a) * jones[2], cross * jones[1] + std::conj(a) * jones[3]};
  }
  const double eo = d.n_o * d.n_o, ee = d.n_e * d.n_e, cos_out = std::cos(outside), cos_in = std::cos(inside);
  double t_p[2], t_s[2];
  if (d.core_radius > 0) {  // the director is normal to the surface: as in IndependentDroplet::ring
    const double q = d.n_host * std::sqrt(ee - std::pow(d.n_host * b / radius, 2));
    const double rs = (d.n_host * cos_out - d.n_o * cos_in) / (d.n_host * cos_out + d.n_o * cos_in),
                 rp = (d.n_o * d.n_e * cos_out - q) / (d.n_o * d.n_e * cos_out + q);
    t_p[0] = t_p[1] = std::sqrt(1 - rp * rp), t_s[0] = t_s[1] = std::sqrt(1 - rs * rs);
  }
  // Elsewhere each polarization passes by its own index along the ray.
  for (int end = 0; end < 2 && d.core_radius == 0; ++end) {
    const Vec n = d.director(place(end == 0 ? 1e-9 : 1 - 1e-9));
    const double np = dot(n, p), ns = dot(n, across), along = dot(n, ray),
                 shared = (ee - eo) * eo / (eo + (ee - eo) * along * along);
    t_p[end] = through(d.n_host / cos_out, std::sqrt(eo + shared * np * np) / cos_in);
    t_s[end] = through(d.n_host * cos_out, std::sqrt(eo + shared * ns * ns) * cos_in);
  }
  const double tip = std::cos(2 * turn);  // of the field in the plane of incidence, what lies in the picture
  const Complex pp = tip * t_p[1] * t_p[0] * jones[0], ps = tip * t_p[1] * t_s[0] * jones[1],
                sp = t_s[1] * t_p[0] * jones[2], ss = t_s[1] * t_s[0] * jones[3];
  // Polarizer along x: (c, -s) in (p, s); analyser along y: (s, c).
  const Complex out = s * (c * pp - s * ps) + c * (c * sp - s * ss);
  return b / (rho * slope) / tip * std::norm(out);
}

void write(const char* path, const Droplet& d, double center_x, double center_y, unsigned long seed) {
  constexpr int kSize = 96, kSub = 8;
  constexpr double kPixel = 0.11;
  std::vector<double> mean;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      double sum = 0;
      for (int i = 0; i < kSub * kSub; ++i)
        sum += light(d, (column - 0.5 + (i % kSub + 0.5) / kSub - center_x) * kPixel,
                     (center_y - (row - 0.5 + (i / kSub + 0.5) / kSub)) * kPixel);
      mean.push_back(120 + 3500 * sum / (kSub * kSub));
    }
  write_pgm(path, kSize, kSize, birefit::testing::camera(mean, 0.5, 4.0, seed));
}

}  // namespace

int main() {
  Droplet bipolar{8.8, 1.52, 1.70, 1.48, 0.59, {}};
  const double azimuth = 28 * M_PI / 180;
  const Vec axis{std::cos(azimuth), std::sin(azimuth), 0};
  bipolar.director = [axis](const Vec& r) {
    const double w = dot(r, axis);
    const Vec off{r[0] - w * axis[0], r[1] - w * axis[1], r[2] - w * axis[2]};
    const double along = 1 + dot(off, off) - w * w;
    Vec n{along * axis[0] - 2 * w * off[0], along * axis[1] - 2 * w * off[1], along * axis[2] - 2 * w * off[2]};
    const double size = length(n);
    for (double& x : n) x /= size;
    return n;
  };
  write("bipolar_droplet.pgm", bipolar, 47.9, 46.6, 4001);

  const double wall = 1.5 / 4.5;
  const Vec offset{0.45 / 4.5, -0.3 / 4.5, 0};
  Droplet shell{9.0, 1.52, 1.70, 1.48, 0.59, {}, offset, 1 - wall};
  shell.director = [wall, offset](const Vec& r) {
    // Of the spheres |r - t offset| = 1 - t wall, the one through here: t by bisection, 1 at the core.
    const auto from = [&](double t) { return Vec{r[0] - t * offset[0], r[1] - t * offset[1], r[2] - t * offset[2]}; };
    double low = 0, high = 1;
    for (int i = 0; i < 60; ++i) {
      const double t = 0.5 * (low + high);
      (length(from(t)) < 1 - t * wall ? low : high) = t;
    }
    Vec n = from(0.5 * (low + high));
    const double size = length(n);
    for (double& x : n) x /= size;
    return n;
  };
  write("eccentric_shell.pgm", shell, 46.8, 48.2, 4002);
}
