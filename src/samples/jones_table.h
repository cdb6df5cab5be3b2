#pragma once
// The rows of `jones`.

#include <array>
#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "birefit/plan.h"
#include "core/jones.h"

namespace birefit {

class JonesTable {
 public:
  explicit JonesTable(double wavelength_nm) : wavelength_nm_(wavelength_nm) {}
  /// A matrix in the lab's x, y as one in the s, p pair of an azimuth: p = (cos, sin), s = (-sin, cos).
  void add(const Mat2<double>& j, double azimuth_rad, JonesRow row) {
    const auto z = [](const Complex<double>& c) { return std::complex<double>(c.re, c.im); };
    const std::complex<double> m[2][2] = {{z(j.a), z(j.b)}, {z(j.c), z(j.d)}};
    const double p[2] = {std::cos(azimuth_rad), std::sin(azimuth_rad)}, s[2] = {-p[1], p[0]};
    const auto element = [&](const double* out, const double* in) {
      std::complex<double> sum = 0;
      for (int a = 0; a < 2; ++a)
        for (int b = 0; b < 2; ++b) sum += out[a] * m[a][b] * in[b];
      return sum;
    };
    row.wavelength_nm = wavelength_nm_;
    row.ss = element(s, s);
    row.ps = element(s, p);
    row.sp = element(p, s);
    row.pp = element(p, p);
    rows_.push_back(row);
  }
  std::vector<JonesRow> rows() && { return std::move(rows_); }

 private:
  double wavelength_nm_;
  std::vector<JonesRow> rows_;
};

}  // namespace birefit
