#include "transport/intensity_distance.h"

#include <algorithm>
#include <cmath>

namespace birefit {

double intensity_distance(const Su2<double>& a, const Su2<double>& b) {
  const auto size = [&](double sign) {
    return square(a.w - sign * b.w) + square(a.x - sign * b.x) + square(a.y - sign * b.y) + square(a.z - sign * b.z);
  };
  return 2 * std::sqrt(std::min(size(1), size(-1)));
}
double intensity_distance(const Mat2<double>& a, const Mat2<double>& b) {
  const Complex<double> inner = conj(b.a) * a.a + conj(b.b) * a.b + conj(b.c) * a.c + conj(b.d) * a.d;
  const double modulus = std::sqrt(norm(inner));
  const Complex<double> turn =
      modulus > 0 ? Complex<double>(inner.re / modulus, inner.im / modulus) : Complex<double>(1.0);
  const Mat2<double> left = turn * b - a;
  return std::sqrt(2.0 * (norm(left.a) + norm(left.b) + norm(left.c) + norm(left.d)));
}

}  // namespace birefit
