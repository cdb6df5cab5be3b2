#pragma once
// Index of refraction against vacuum wavelength: the formulas of refractiveindex.info by their numbers there
// ("Dispersion formulas" among the documents of its database), and tables. docs/methods.md, "Materials".

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "birefit/scene.h"
#include "core/scalar.h"

namespace birefit {

/// x^p, x > 0, p a plain number. Whole powers by multiplication: exact where they are, and cheaper than exp and log.
template <class S>
S real_power(const S& x, double p) {
  const double size = std::abs(p);
  if (size != std::floor(size) || size > 32) return exp(p * log(x));
  S r(1.0), square_of_square = x;
  for (unsigned left = static_cast<unsigned>(size); left != 0; left /= 2) {
    if (left % 2 != 0) r = r * square_of_square;
    square_of_square = square_of_square * square_of_square;
  }
  return p < 0 ? S(1.0) / r : r;
}

/// Cubic pieces with the slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 300 (1984)): through every point,
/// once differentiable, and without the overshoot of splines where a table is rough. `x` within the table.
template <class S>
S table_index(const std::vector<double>& xs, const std::vector<double>& ys, const S& x) {
  const std::size_t last = xs.size() - 1;
  const double at = lane(plain(x), 0);  // all lanes share one wavelength
  const std::size_t i = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(
                                     std::upper_bound(xs.begin(), xs.end(), at) - xs.begin() - 1, 0)),
                                 last - 1);
  const auto width = [&](std::size_t k) { return xs[k + 1] - xs[k]; };
  const auto secant = [&](std::size_t k) { return (ys[k + 1] - ys[k]) / width(k); };
  const auto slope = [&](std::size_t k) {
    if (k == 0) return secant(0);
    if (k == last) return secant(last - 1);
    const double a = secant(k - 1), b = secant(k);
    if (a * b <= 0) return 0.0;  // an extremum of the table stays one
    const double wa = width(k - 1) + 2 * width(k), wb = 2 * width(k - 1) + width(k);
    return (wa + wb) / (wa / b + wb / a);
  };
  const double h = width(i), d = secant(i), m0 = slope(i), m1 = slope(i + 1);
  const S t = x - xs[i];
  return ys[i] + t * (m0 + t * ((3 * d - 2 * m0 - m1) / h + t * ((m0 + m1 - 2 * d) / (h * h))));
}

/// n at a wavelength in um. `value(ref)` gives a parameter as S.
template <class S, class V>
S index_at(const Dispersion& law, const S& wavelength_um, const V& value) {
  using Form = Dispersion::Form;
  const S& l = wavelength_um;
  const S l2 = l * l;
  const std::size_t count = law.coefficients.size();
  // from C1, 0 beyond the last
  const auto constant = [&](std::size_t i) { return i <= count ? law.coefficients[i - 1] : 0.0; };
  const auto c = [&](std::size_t i) {
    return i <= law.refs.size() && law.refs[i - 1] ? S(value(law.refs[i - 1])) : S(constant(i));
  };
  /// sum of C_i l^C_{i+1} from i = first on
  const auto powers = [&](std::size_t first) {
    S sum(0.0);
    for (std::size_t i = first; i + 1 <= count; i += 2) sum = sum + c(i) * real_power(l, constant(i + 1));
    return sum;
  };
  switch (law.form) {
    case Form::sellmeier: {
      S n2 = 1.0 + c(1);
      for (std::size_t i = 2; i + 1 <= count; i += 2) n2 = n2 + c(i) * l2 / (l2 - c(i + 1) * c(i + 1));
      return sqrt(n2);
    }
    case Form::sellmeier_2: {
      S n2 = 1.0 + c(1);
      for (std::size_t i = 2; i + 1 <= count; i += 2) n2 = n2 + c(i) * l2 / (l2 - c(i + 1));
      return sqrt(n2);
    }
    case Form::polynomial:
      return sqrt(c(1) + powers(2));
    case Form::refractiveindex_info: {
      S n2 = c(1) + powers(10);
      for (std::size_t i : {std::size_t{2}, std::size_t{6}})
        if (constant(i) != 0)
          n2 = n2 + c(i) * real_power(l, constant(i + 1)) / (l2 - std::pow(constant(i + 2), constant(i + 3)));
      return sqrt(n2);
    }
    case Form::cauchy:
      return c(1) + powers(2);
    case Form::gases: {
      S n = 1.0 + c(1);
      for (std::size_t i = 2; i + 1 <= count; i += 2) n = n + c(i) / (c(i + 1) - 1.0 / l2);
      return n;
    }
    case Form::herzberger: {
      const S r = 1.0 / (l2 - 0.028);
      return c(1) + c(2) * r + c(3) * r * r + l2 * (c(4) + l2 * (c(5) + l2 * c(6)));
    }
    case Form::retro: {
      const S f = c(1) + c(2) * l2 / (l2 - c(3)) + c(4) * l2;  // (n^2 - 1)/(n^2 + 2)
      return sqrt((1.0 + 2.0 * f) / (1.0 - f));
    }
    case Form::exotic: {
      const S d = l - c(5);
      return sqrt(c(1) + c(2) / (l2 - c(3)) + c(4) * d / (d * d + c(6)));
    }
    case Form::table:
      break;
  }
  return table_index(law.wavelength_um, law.index, l);
}

}  // namespace birefit
