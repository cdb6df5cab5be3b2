#pragma once
// A disc under diametral load between polarizers, computed without a line of birefit: textbook stresses, principal
// stresses and their azimuth, the textbook intensity of both polariscopes.

#include <cmath>
#include <numbers>

namespace birefit::testing {

struct IndependentDisc {
  double center_x_px = 63.5, center_y_px = 63.5;
  double um_per_px = 100, radius_um = 6000;
  double load_n = 300, stress_optic_brewster = 50, thickness_um = 6000;
  double wavelength_nm = 546;
  double load_azimuth_deg = 90, polarizer_deg = 0;
  double residual_pa = 0;  ///< uniform stress across the load, there without it
  bool circular = true;

  struct Stress {
    double sxx, syy, sxy;  ///< Pa; y along the load
  };
  Stress stress(double x_um, double y_um) const {
    const double R = radius_um * 1e-6, t = thickness_um * 1e-6, x = x_um * 1e-6, y = y_um * 1e-6;
    const double c = 2 * load_n / (std::numbers::pi * t);
    const double up = R - y, down = R + y;
    const double r1 = std::hypot(x, up), r2 = std::hypot(x, down);
    const double f1 = 1 / std::pow(r1, 4), f2 = 1 / std::pow(r2, 4);
    return {residual_pa - c * (up * x * x * f1 + down * x * x * f2 - 1 / (2 * R)),
            -c * (std::pow(up, 3) * f1 + std::pow(down, 3) * f2 - 1 / (2 * R)),
            c * (up * up * x * f1 - down * down * x * f2)};
  }
  /// Dark field, crossed polarizers; 0 outside.
  double intensity(double column, double row) const {
    const double east = (column - center_x_px) * um_per_px, north = (center_y_px - row) * um_per_px;
    if (std::hypot(east, north) > radius_um) return 0;
    const double turn = (load_azimuth_deg - 90) * std::numbers::pi / 180;
    const double x = east * std::cos(turn) + north * std::sin(turn), y = north * std::cos(turn) - east * std::sin(turn);
    const Stress s = stress(x, y);
    const double difference = std::hypot(s.sxx - s.syy, 2 * s.sxy);
    const double alpha = 0.5 * std::atan2(2 * s.sxy, s.sxx - s.syy) + turn;
    const double delta = 2 * std::numbers::pi / (wavelength_nm * 1e-9) * stress_optic_brewster * 1e-12 * thickness_um *
                         1e-6 * difference;
    const double fringe = std::pow(std::sin(delta / 2), 2);
    if (circular) return fringe;
    return std::pow(std::sin(2 * (alpha - polarizer_deg * std::numbers::pi / 180)), 2) * fringe;
  }
  /// Mean over the pixel, n x n midpoints.
  double pixel(int column, int row, int n) const {
    double sum = 0;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) sum += intensity(column - 0.5 + (i + 0.5) / n, row - 0.5 + (j + 0.5) / n);
    return sum / (n * n);
  }
};

}  // namespace birefit::testing
