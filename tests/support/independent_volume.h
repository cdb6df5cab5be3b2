#pragma once
// A sampled director field seen between polarizers, by formulas of its own: eigenvectors in closed form, complex Jones
// matrices of thin slices. Shares no code with the model.

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

namespace birefit::testing {

struct IndependentVolume {
  int nx = 0, ny = 0, nz = 0;
  double spacing_um = 1;
  std::vector<std::array<float, 3>> director;  ///< x fastest
  std::vector<unsigned char> inside;
  double n_o = 1.52, birefringence = 0.1, wavelength_um = 0.59;
  double polarizer_deg = 0, analyzer_deg = 90, rotation_deg = 0;
  double center_x_px = 0, center_y_px = 0, um_per_px = 0.1;
  int slices = 6;  ///< between two layers

  /// Mean of the n x n points of a pixel.
  double pixel(int column, int row, int n) const {
    double sum = 0;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) sum += point(column + (i + 0.5) / n - 0.5, row + (j + 0.5) / n - 0.5);
    return sum / (n * n);
  }
  double point(double column, double row) const {
    const double rad = std::numbers::pi / 180, turn = rotation_deg * rad;
    const double east = (column - center_x_px) * um_per_px, north = (center_y_px - row) * um_per_px;
    const double x = (std::cos(turn) * east + std::sin(turn) * north) / spacing_um + 0.5 * (nx - 1);
    const double y = (std::cos(turn) * north - std::sin(turn) * east) / spacing_um + 0.5 * (ny - 1);
    using C = std::complex<double>;
    C ex = std::cos(polarizer_deg * rad), ey = std::sin(polarizer_deg * rad);
    if (x >= 0 && y >= 0 && x <= nx - 1 && y <= ny - 1)
      for (int k = 0; k < (nz - 1) * slices; ++k) {
        const std::array<double, 6> t = tensor(x, y, (k + 0.5) / slices);
        const double weight = t[0] + t[1] + t[2];
        if (!(weight > 0)) continue;
        const std::array<double, 3> a = axis(t);
        const double n_e = n_o + weight * birefringence, sin2 = a[0] * a[0] + a[1] * a[1];
        const double seen = n_o * n_e / std::sqrt(n_o * n_o * sin2 + n_e * n_e * (1 - sin2));
        const double half = std::numbers::pi / wavelength_um * (seen - n_o) * spacing_um / slices;
        const double azimuth = std::atan2(a[1], a[0]) + turn, c = std::cos(azimuth), s = std::sin(azimuth);
        const C along = (c * ex + s * ey) * std::polar(1.0, half), across = (c * ey - s * ex) * std::polar(1.0, -half);
        ex = c * along - s * across;
        ey = s * along + c * across;
      }
    return std::norm(std::cos(analyzer_deg * rad) * ex + std::sin(analyzer_deg * rad) * ey);
  }

 private:
  /// xx, yy, zz, xy, xz, yz between the eight nodes around.
  std::array<double, 6> tensor(double x, double y, double z) const {
    const int i = std::min(static_cast<int>(x), nx - 2), j = std::min(static_cast<int>(y), ny - 2),
              k = std::min(static_cast<int>(z), nz - 2);
    std::array<double, 6> t{};
    for (int corner = 0; corner < 8; ++corner) {
      const int a = corner & 1, b = corner >> 1 & 1, c = corner >> 2;
      const std::size_t node =
          (static_cast<std::size_t>(k + c) * static_cast<std::size_t>(ny) + static_cast<std::size_t>(j + b)) *
              static_cast<std::size_t>(nx) +
          static_cast<std::size_t>(i + a);
      if (!inside[node]) continue;
      const double w = (a ? x - i : 1 - x + i) * (b ? y - j : 1 - y + j) * (c ? z - k : 1 - z + k);
      const double p = director[node][0], q = director[node][1], r = director[node][2];
      const double add[6] = {p * p, q * q, r * r, p * q, p * r, q * r};
      for (std::size_t m = 0; m < 6; ++m) t[m] += w * add[m];
    }
    return t;
  }
  /// Of the largest eigenvalue: the root of the characteristic cubic by cosines, the vector from a cross product of two
  /// rows.
  static std::array<double, 3> axis(const std::array<double, 6>& t) {
    const double mean = (t[0] + t[1] + t[2]) / 3, a = t[0] - mean, b = t[1] - mean, c = t[2] - mean;
    const double p = std::sqrt((a * a + b * b + c * c + 2 * (t[3] * t[3] + t[4] * t[4] + t[5] * t[5])) / 6);
    if (!(p > 0)) return {0, 0, 1};
    const double det = a * (b * c - t[5] * t[5]) - t[3] * (t[3] * c - t[5] * t[4]) + t[4] * (t[3] * t[5] - b * t[4]);
    const double angle = std::acos(std::max(-1.0, std::min(1.0, det / (2 * p * p * p)))) / 3,
                 top = 2 * p * std::cos(angle);
    const double m[3][3] = {{a - top, t[3], t[4]}, {t[3], b - top, t[5]}, {t[4], t[5], c - top}};
    std::array<double, 3> best{0, 0, 1};
    double longest = 0;
    for (int i = 0; i < 3; ++i) {
      const double *u = m[i], *v = m[(i + 1) % 3];
      const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0],
                   length = std::sqrt(x * x + y * y + z * z);
      if (length > longest) {
        longest = length;
        best = {x / length, y / length, z / length};
      }
    }
    return best;
  }
};

/// Nodes of a cube of n^3 around a radial droplet of radius R (um) whose middle is the cube's.
inline IndependentVolume radial_ball(int n, double radius_um, double half_side_um) {
  IndependentVolume v;
  v.nx = v.ny = v.nz = n;
  v.spacing_um = 2 * half_side_um / (n - 1);
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const double x = (i - 0.5 * (n - 1)) * v.spacing_um, y = (j - 0.5 * (n - 1)) * v.spacing_um,
                     z = (k - 0.5 * (n - 1)) * v.spacing_um, r = std::sqrt(x * x + y * y + z * z);
        const bool in = r <= radius_um && r > 0;
        v.inside.push_back(in);
        v.director.push_back(
            in ? std::array<float, 3>{static_cast<float>(x / r), static_cast<float>(y / r), static_cast<float>(z / r)}
               : std::array<float, 3>{0, 0, 0});
      }
  return v;
}

}  // namespace birefit::testing
