#pragma once
// The picture of a field behind an object, by one Fourier transform of the field set in a large empty frame. Shares
// with src/ only the transform itself.

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "wave/fft.h"

namespace birefit::testing {

/// Tangential field in the plane focused on, at the points of the box, ny rows of nx, row 0 = smallest y.
struct Picture {
  Plane ex, ey;
  /// Behind an analyser crossed with a polarizer at this angle from x; the incident field must be what that polarizer
  /// lets through.
  std::vector<double> crossed(double polarizer_rad) const {
    std::vector<double> intensity(ex.size());
    for (std::size_t i = 0; i < ex.size(); ++i)
      intensity[i] = std::norm(std::cos(polarizer_rad) * ey[i] - std::sin(polarizer_rad) * ex[i]);
    return intensity;
  }
};

struct Imaging {
  double k0_per_um, n_host, aperture;  ///< waves with |kappa| > aperture are cut away
  double exit_um;                      ///< z of the field that is imaged
  double focus_um = 0;                 ///< z of the plane focused on
  /// the incident wave, e exp(i k0 (kappa.r + q z)); its factor exp(i k0 kappa.r) is left out in both fields
  std::array<double, 2> kappa{0, 0};
  std::array<std::complex<double>, 2> e{1, 0};

  /// added_x, added_y: what the object adds to the incident wave at z = exit_um, nx * ny points over box_x * box_y um.
  /// The frame is `pad` boxes wide: what leaves the box must not come in again on the other side (1: a periodic
  /// object).
  Picture operator()(const Plane& added_x, const Plane& added_y, int nx, int ny, double box_x_um, double box_y_um,
                     int pad = 3) const {
    const int pad_y = ny == 1 ? 1 : pad, wide = pad * nx, high = pad_y * ny, left = (wide - nx) / 2,
              below = (high - ny) / 2;
    const Fft2 fft(wide, high);
    const auto q = [this](double kx, double ky) {
      return std::sqrt(std::complex<double>(n_host * n_host - kx * kx - ky * ky));
    };
    const auto direct = std::hypot(kappa[0], kappa[1]) > aperture
                            ? 0.0
                            : std::exp(std::complex<double>(0, k0_per_um * focus_um) * q(kappa[0], kappa[1]));
    const auto image = [&](const Plane& added, std::complex<double> incident) {
      Plane frame(fft.size(), 0);
      for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i) frame[at(i + left, j + below, wide)] = added[at(i, j, nx)];
      fft.forward(frame);
      for (int j = 0; j < high; ++j)
        for (int i = 0; i < wide; ++i) {
          const double kx =
              kappa[0] + (2 * i < wide ? i : i - wide) * 2 * std::numbers::pi / (k0_per_um * pad * box_x_um);
          const double ky =
              kappa[1] +
              (high == 1 ? 0 : (2 * j < high ? j : j - high) * 2 * std::numbers::pi / (k0_per_um * pad_y * box_y_um));
          std::complex<double>& wave = frame[at(i, j, wide)];
          if (std::hypot(kx, ky) > aperture)
            wave = 0;
          else
            wave *= std::exp(std::complex<double>(0, k0_per_um * (focus_um - exit_um)) * q(kx, ky)) /
                    static_cast<double>(fft.size());
        }
      fft.inverse(frame);
      Plane box(added.size());
      for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i) box[at(i, j, nx)] = frame[at(i + left, j + below, wide)] + incident * direct;
      return box;
    };
    return {image(added_x, e[0]), image(added_y, e[1])};
  }

 private:
  static std::size_t at(int i, int j, int width) {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(i);
  }
};

/// Root mean square of the difference over that of the reference.
inline double relative_rms(const std::vector<double>& values, const std::vector<double>& reference) {
  double difference = 0, sum = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    difference += (values.at(i) - reference[i]) * (values[i] - reference[i]);
    sum += reference[i] * reference[i];
  }
  return std::sqrt(difference / sum);
}

}  // namespace birefit::testing
