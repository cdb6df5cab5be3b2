#pragma once
// A radial droplet between crossed polarizers, computed a second time from the textbook formulas alone: shares nothing
// with src/. Slow on purpose: bisection, adaptive Simpson, plain subpixels. Makes the shipped micrograph and the truth
// of recovery tests.
//
// Ray of impact b: Snell at the sphere, sin psi = b/R, sin psi' = (n_host/n_o) sin psi, turned by 2 (psi - psi'), seen
// in the mid plane at rho = b / cos(2 (psi - psi')). Extraordinary index on the chord: 1/n^2 = cos^2 g/n_o^2 + sin^2
// g/n_e^2. Fresnel: s on n_o; p on a uniaxial surface with its axis along the normal (Lekner, J. Phys. Condens. Matter
// 3, 6121 (1991)). Field in the focal plane: flux through the ray tube, transverse part of p.

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace birefit::testing {

struct IndependentDroplet {
  double diameter_um = 9.3, n_o = 1.52, n_e = 1.74, n_host = 1.43, wavelength_um = 0.59;
  double center_x_px = 0, center_y_px = 0, pixel_um = 0.05, polarizer_deg = 0;

  bool surfaces = true;  ///< reflect; without, all light goes through them

  /// Angle of the director from the viewing axis at (rho, z) over the radius, upper half; the lower half mirrors it.
  /// Not set: the radial hedgehog.
  std::function<double(double, double)> angle_from_axis;

  /// Along the refracted ray of impact b outside: Simpson's rule on 2,000 pieces.
  double retardance_of_field_um(double b) const {
    const double radius = diameter_um / 2, outside = std::asin(b / radius),
                 inside = std::asin(n_host / n_o * b / radius);
    const double turn = outside - inside, length = 2 * radius * std::cos(inside);
    constexpr int kPieces = 2000;
    double sum = 0;
    for (int i = 0; i <= kPieces; ++i) {
      const double t = length * i / kPieces;
      const double rho = (b - t * std::sin(turn)) / radius,
                   z = (t * std::cos(turn) - radius * std::cos(outside)) / radius;
      const double angle = angle_from_axis(std::abs(rho), std::abs(z));
      const double along =
          -std::sin(turn) * std::sin(angle) * (rho < 0 ? -1 : 1) + std::cos(turn) * std::cos(angle) * (z < 0 ? -1 : 1);
      const double cos2 = along * along;
      const double n = 1 / std::sqrt(cos2 / (n_o * n_o) + (1 - cos2) / (n_e * n_e)) - n_o;
      sum += n * (i == 0 || i == kPieces ? 1 : i % 2 ? 4 : 2);
    }
    return sum * length / kPieces / 3;
  }

  double retardance_um(double impact_inside) const {
    if (angle_from_axis) return retardance_of_field_um(impact_inside * n_o / n_host);
    const double radius = diameter_um / 2, b = impact_inside;
    const double half = std::sqrt(radius * radius - b * b);
    const auto f = [&](double s) {
      const double r2 = s * s + b * b;
      const double cos2 = s * s / r2, sin2 = b * b / r2;
      return 1 / std::sqrt(cos2 / (n_o * n_o) + sin2 / (n_e * n_e)) - n_o;
    };
    const std::function<double(double, double, double, double, double, int)> simpson =
        [&](double a, double c, double fa, double fm, double fc, int depth) -> double {
      const double m = (a + c) / 2, f1 = f((a + m) / 2), f2 = f((m + c) / 2);
      const double whole = (c - a) / 6 * (fa + 4 * fm + fc);
      const double parts = (c - a) / 12 * (fa + 4 * f1 + 2 * fm + 4 * f2 + fc);
      if (depth <= 0 || std::abs(parts - whole) < 1e-9) return parts + (parts - whole) / 15;
      return simpson(a, m, fa, f1, fm, depth - 1) + simpson(m, c, fm, f2, fc, depth - 1);
    };
    return 2 * simpson(0, half, f(0), f(half / 2), f(half), 20);
  }

  /// Image radius beyond which there is no light.
  double edge_um() const {
    const double radius = diameter_um / 2, m = n_host / n_o, b = radius * std::min(1.0, 1 / m) * (1 - 1e-12);
    return b / std::cos(2 * (std::asin(b / radius) - std::asin(m * b / radius)));
  }

  /// |E_cross|^2 / sin^2(2 phi) at image radius rho.
  double ring(double rho) const {
    const double radius = diameter_um / 2, m = n_host / n_o;
    const auto seen_at = [&](double b) {
      const double turn = 2 * (std::asin(b / radius) - std::asin(m * b / radius));
      return b / std::cos(turn);
    };
    double low = 0, high = radius * std::min(1.0, 1 / m) * (1 - 1e-12);
    if (rho <= 0 || rho >= seen_at(high)) return 0;
    for (int i = 0; i < 200; ++i) {
      const double middle = 0.5 * (low + high);
      (seen_at(middle) < rho ? low : high) = middle;
    }
    const double b = 0.5 * (low + high), h = 1e-6 * std::min(b, radius - b) + 1e-13;
    const double slope = (seen_at(b + h) - seen_at(b - h)) / (2 * h);
    const double s1 = b / radius, c1 = std::sqrt(1 - s1 * s1), s2 = m * s1, c2 = std::sqrt(1 - s2 * s2);
    const double cosine = std::cos(2 * (std::asin(s1) - std::asin(s2)));
    const double rs = (n_host * c1 - n_o * c2) / (n_host * c1 + n_o * c2);
    const double root = n_host * std::sqrt(n_e * n_e - n_host * n_host * s1 * s1);
    const double rp = (n_o * n_e * c1 - root) / (n_o * n_e * c1 + root);
    const double p = (surfaces ? 1 - rp * rp : 1.0) * cosine, s = surfaces ? 1 - rs * rs : 1.0;
    const double delta = 2 * M_PI / wavelength_um * retardance_um(m * b);
    const double tube = b / (rho * slope) / cosine;
    return 0.25 * tube * (p * p + s * s - 2 * p * s * std::cos(delta));
  }

  /// Mean over the pixel, n x n midpoints.
  double pixel(int column, int row, int n = 5) const {
    double sum = 0;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const double x = (column - 0.5 + (i + 0.5) / n - center_x_px) * pixel_um;
        const double y = (center_y_px - (row - 0.5 + (j + 0.5) / n)) * pixel_um;
        const double angle = std::atan2(y, x) - polarizer_deg * M_PI / 180;
        sum += ring(std::hypot(x, y)) * std::pow(std::sin(2 * angle), 2);
      }
    return sum / (n * n);
  }
};

/// Counts of a camera: Poisson photons and Gaussian read noise, rounded.
inline std::vector<double> camera(const std::vector<double>& mean_counts, double counts_per_photon, double read_counts,
                                  unsigned long seed, bool rounded = true) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> read(0, read_counts);
  std::vector<double> counts;
  for (double mean : mean_counts) {
    std::poisson_distribution<long> photons(std::max(0.0, mean / counts_per_photon));
    const double value = static_cast<double>(photons(random)) * counts_per_photon + read(random);
    counts.push_back(rounded ? std::round(value) : value);
  }
  return counts;
}

}  // namespace birefit::testing
