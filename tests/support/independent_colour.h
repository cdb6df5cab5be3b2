#pragma once
// A radial droplet between crossed polarizers in white light, one wavelength after the other, as the three colours of a
// camera see it. Shares nothing with src/. Lamp: a black body. Birefringence by one absorption band.

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "independent_droplet.h"

namespace birefit::testing {

/// wavelength_nm and r, g, b of each row of a camera's table.
using CameraRows = std::vector<std::array<double, 4>>;
inline CameraRows camera_rows(const std::string& file) {
  std::ifstream table(file);
  std::string line;
  std::getline(table, line);
  CameraRows rows;
  while (std::getline(table, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream cells(line);
    std::array<double, 4> row{};
    for (double& x : row) cells >> x;
    rows.push_back(row);
  }
  return rows;
}

struct IndependentColourDroplet {
  IndependentDroplet droplet;  ///< its n_e and wavelength are not looked at
  double birefringence = 0.2, resonance_nm = 0, planck_k = 2856;
  int radii = 1500, subpixels = 6;

  /// Means over pixels, row by row, as fractions of what each colour records without sample and polarizers.
  std::array<std::vector<double>, 3> pictures(const CameraRows& camera, int size) const {
    IndependentDroplet line = droplet;
    const double step_um = droplet.edge_um() / radii;
    const auto places = static_cast<std::size_t>(radii);
    std::array<std::vector<double>, 3> ring;
    for (auto& colour : ring) colour.assign(places + 2, 0.0);
    std::array<double, 3> white{};
    // The trapezium rule over half steps of the table, whose ends are next to 0.
    for (std::size_t i = 0; i + 1 < 2 * camera.size(); ++i) {
      const auto cell = [&](std::size_t c) {
        return i % 2 ? 0.5 * (camera[i / 2][c] + camera[i / 2 + 1][c]) : camera[i / 2][c];
      };
      const double nm = cell(0), um = 1e-3 * nm, w2 = nm * nm, s2 = 589.3 * 589.3, r2 = resonance_nm * resonance_nm;
      const double lamp = std::pow(um, -5) / std::expm1(14387.76877 / (um * planck_k));
      line.wavelength_um = um;
      line.n_e = line.n_o + birefringence * w2 * (s2 - r2) / (s2 * (w2 - r2));
      for (std::size_t c = 0; c < 3; ++c) white[c] += lamp * cell(c + 1);
      for (std::size_t j = 1; j <= places + 1; ++j) {
        const double light = lamp * line.ring(static_cast<double>(j) * step_um);
        for (std::size_t c = 0; c < 3; ++c) ring[c][j] += light * cell(c + 1);
      }
    }
    std::array<std::vector<double>, 3> seen;
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        std::array<double, 3> mean{};
        for (int b = 0; b < subpixels; ++b)
          for (int a = 0; a < subpixels; ++a) {
            const double x = (column - 0.5 + (a + 0.5) / subpixels - droplet.center_x_px) * droplet.pixel_um,
                         y = (droplet.center_y_px - (row - 0.5 + (b + 0.5) / subpixels)) * droplet.pixel_um,
                         rho = std::hypot(x, y) / step_um;
            if (rho >= radii) continue;
            const double turned = std::pow(std::sin(2 * std::atan2(y, x)), 2), part = rho - std::floor(rho);
            const auto j = static_cast<std::size_t>(rho);
            for (std::size_t c = 0; c < 3; ++c)
              mean[c] += turned * ((1 - part) * ring[c][j] + part * ring[c][j + 1]) / (subpixels * subpixels);
          }
        for (std::size_t c = 0; c < 3; ++c) seen[c].push_back(mean[c] / white[c]);
      }
    return seen;
  }
};

}  // namespace birefit::testing
