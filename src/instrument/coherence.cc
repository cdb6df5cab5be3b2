#include "instrument/coherence.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <stdexcept>

namespace birefit {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
/// Chebyshev points of [-1, 1], and values there to coefficients of powers by way of those of Chebyshev polynomials:
/// these fall off, so that what the powers lose to cancellation is lost of small numbers (core/chebyshev.h goes
/// straight to powers, which costs six digits for sixteen points).
template <std::size_t n>
struct Points {
  std::array<double, n> x;
  std::array<std::array<double, n>, n> cosine, powers;  // [order][point], [order][power]
  Points() : cosine{}, powers{} {
    for (std::size_t j = 0; j < n; ++j) {
      const double angle = std::numbers::pi * (static_cast<double>(j) + 0.5) / static_cast<double>(n);
      x[j] = std::cos(angle);
      for (std::size_t m = 0; m < n; ++m)
        cosine[m][j] = (m == 0 ? 1.0 : 2.0) / static_cast<double>(n) * std::cos(static_cast<double>(m) * angle);
    }
    powers[0][0] = powers[1][1] = 1;
    for (std::size_t m = 2; m < n; ++m)
      for (std::size_t c = 0; c <= m; ++c) powers[m][c] = (c > 0 ? 2 * powers[m - 1][c - 1] : 0.0) - powers[m - 2][c];
  }
  std::array<double, n> to_powers(const std::array<double, n>& values) const {
    std::array<double, n> result{};
    for (std::size_t m = 0; m < n; ++m) {
      double coefficient = 0;
      for (std::size_t j = 0; j < n; ++j) coefficient += cosine[m][j] * values[j];
      for (std::size_t c = 0; c <= m; ++c) result[c] += coefficient * powers[m][c];
    }
    return result;
  }
};

/// Farthest that the fastest phase goes within a panel, rad: sixteen points leave 2 J_16(2) < 2e-13 of it.
constexpr double kPhaseOfPanel = 4;

std::vector<std::vector<double>> rows_of(const SpectralSum& sum) {
  std::vector<std::vector<double>> rows = sum.weight;
  for (const auto& number : sum.slope) rows.insert(rows.end(), number.begin(), number.end());
  return rows;
}

}  // namespace

Coherence::Coherence(const SpectralSum& sum, const std::vector<double>& t, double reach_um)
    : Coherence(rows_of(sum), t, reach_um) {
  channels_ = sum.channels();
}

Coherence::Coherence(std::vector<std::vector<double>> rows, std::vector<double> t, double reach_um)
    : channels_(rows.size()), row_(std::move(rows)), t_(std::move(t)), reach_(reach_um) {
  for (const std::vector<double>& row : row_)
    if (row.size() != t_.size()) throw std::logic_error("Coherence: a row is not of the places in t");
  if (t_.empty() || !(reach_ > 0)) throw std::logic_error("Coherence: no wavelengths or no reach");
  const double fastest = *std::max_element(t_.begin(), t_.end());
  if (!std::isfinite(fastest) || !(fastest > 0)) throw std::logic_error("Coherence: t is no number above 0");
  width_ = std::min(reach_, kPhaseOfPanel / (kTurn * fastest));
  panels_ = static_cast<std::size_t>(std::ceil(reach_ / width_));
  width_ = reach_ / static_cast<double>(panels_);
  tabulate();
}

void Coherence::tabulate() {
  using Row = std::array<double, kPoints>;
  static const Points<kPoints> points;
  const std::size_t count = t_.size();
  panel_.assign(row_.size() * panels_, Panel{});
  // e^{2 pi i x t} for the places x of the points from a panel's middle: every panel takes one sine a wavelength.
  std::vector<Row> cosine(count), sine(count);
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t j = 0; j < kPoints; ++j)
      sin_cos(kTurn * t_[k] * 0.5 * width_ * points.x[j], sine[k][j], cosine[k][j]);
  std::vector<std::array<Row, 2>> value(row_.size());
  for (std::size_t p = 0; p < panels_; ++p) {
    std::fill(value.begin(), value.end(), std::array<Row, 2>{});
    for (std::size_t k = 0; k < count; ++k) {
      Row loss, im;
      double s, c;
      sin_cos(kTurn * t_[k] * (static_cast<double>(p) + 0.5) * width_, s, c);
      for (std::size_t j = 0; j < kPoints; ++j) {
        loss[j] = 1 - (c * cosine[k][j] - s * sine[k][j]);
        im[j] = s * cosine[k][j] + c * sine[k][j];
      }
      for (std::size_t j = 0; p == 0 && j < kPoints; ++j) {
        const double g2 = 0.5 * width_ * width_ * (1 + points.x[j]), g = std::sqrt(g2);
        loss[j] = 2 * square(std::sin(0.5 * kTurn * t_[k] * g)) / g2;
        im[j] = std::sin(kTurn * t_[k] * g) / g;
      }
      for (std::size_t r = 0; r < row_.size(); ++r)
        for (std::size_t j = 0; j < kPoints; ++j) {
          value[r][0][j] += row_[r][k] * loss[j];
          value[r][1][j] += row_[r][k] * im[j];
        }
    }
    for (std::size_t r = 0; r < row_.size(); ++r)
      for (std::size_t part = 0; part < 2; ++part) {
        const Row powers = points.to_powers(value[r][part]);
        for (std::size_t c = 0; c < kPoints; ++c) panel_[r * panels_ + p].power[c][part] = powers[c];
      }
  }
}

Coherence::WithSlope<double> Coherence::beyond(std::size_t row, double g) const {
  WithSlope<double> v{0, 0, 0, 0};
  for (std::size_t k = 0; k < t_.size(); ++k) {
    double s, c;
    sin_cos(kTurn * t_[k] * g, s, c);
    const double w = row_[row][k], rate = w * kTurn * t_[k];
    v.loss += w * (1 - c);
    v.im += w * s;
    v.loss_slope += rate * s;
    v.im_slope += rate * c;
  }
  return v;
}

// A coefficient of each lane's own panel, whose number is a whole `p`.
static double pick(const double* from, double p, std::size_t stride) {
  return from[static_cast<std::size_t>(p) * stride];
}
static Pack pick(const double* from, const Pack& p, std::size_t stride) {
  return Pack::gather(from, xsimd::batch_cast<std::int64_t>(p * static_cast<double>(stride)));
}
template <class P, class Coefficient>
BIREFIT_INLINE Coherence::WithSlope<P> Coherence::polynomials(const P& x, const Coefficient& coefficient) {
  P loss(0.0), im(0.0), loss_slope(0.0), im_slope(0.0);
  for (std::size_t c = kPoints; c-- > 0;) {
    loss_slope = loss_slope * x + loss;
    im_slope = im_slope * x + im;
    loss = loss * x + coefficient(2 * c);
    im = im * x + coefficient(2 * c + 1);
  }
  return {loss, im, loss_slope, im_slope};
}

template <class P>
Coherence::WithSlope<P> Coherence::values(std::size_t row, const P& g) const {
  const P size = max_of(g, P(0.0) - g), place = size * (1 / width_);
  if (!all(place < P(static_cast<double>(panels_)))) return beyond(row, g);
  using std::floor, xsimd::floor;
  const P p = floor(place);
  const auto first = p == P(0.0);
  const P x = select(first, 2.0 * place * place, 2.0 * (place - p)) - P(1.0);
  const double* power = panel_[row * panels_].power[0];
  constexpr std::size_t kStride = sizeof(Panel) / sizeof(double);
  // Neighbours in a picture mostly share a panel.
  const double* shared = power + static_cast<std::size_t>(lane(p, 0)) * kStride;
  const WithSlope<P> v = all(p == P(lane(p, 0)))
                             ? polynomials(x, [&](std::size_t i) { return P(shared[i]); })
                             : polynomials(x, [&](std::size_t i) { return pick(power + i, p, kStride); });
  // In the first panel x = 2 (g/width)^2 - 1, and the polynomials are of loss/g^2 and im/g.
  const P dx = g * (4 / (width_ * width_)), sign = select(g < P(0.0), P(-1.0), P(1.0));
  const double scale = 2 / width_;
  return {select(first, g * g * v.loss, v.loss), select(first, g * v.im, sign * v.im),
          select(first, g * (2.0 * v.loss + g * v.loss_slope * dx), sign * v.loss_slope * scale),
          select(first, v.im + g * v.im_slope * dx, v.im_slope * scale)};
}
template Coherence::WithSlope<double> Coherence::values(std::size_t, const double&) const;
template Coherence::WithSlope<Pack> Coherence::values(std::size_t, const Pack&) const;

Coherence::WithSlope<Pack> Coherence::beyond(std::size_t row, const Pack& g) const {
  alignas(64) double at[kLanes], out[4][kLanes];
  g.store_aligned(at);
  for (int i = 0; i < kLanes; ++i) {
    const WithSlope<double> v = values(row, at[i]);
    out[0][i] = v.loss;
    out[1][i] = v.im;
    out[2][i] = v.loss_slope;
    out[3][i] = v.im_slope;
  }
  return {Pack::load_aligned(out[0]), Pack::load_aligned(out[1]), Pack::load_aligned(out[2]),
          Pack::load_aligned(out[3])};
}

double gaussian_line_error(const PhaseSeries<double>& phase, double sigma) {
  using C = std::complex<double>;
  const double s2 = sigma * sigma;
  const C z(1, -s2 * phase.d2), u = s2 / z, m2 = -phase.d1 * phase.d1 * u * u;
  const double envelope = std::abs(std::exp(-0.5 * phase.d1 * phase.d1 * u) / std::sqrt(z));
  // <y^4> and <y^6> about the moved mean: of the fourth order and of half the square of the third.
  const C fourth = m2 * m2 + 6.0 * m2 * u + 3.0 * u * u;
  const C sixth = m2 * m2 * m2 + 15.0 * m2 * m2 * u + 45.0 * m2 * u * u + 15.0 * u * u * u;
  return envelope * std::abs(C(0, phase.d4 / 24) * fourth - phase.d3 * phase.d3 / 72 * sixth);
}

}  // namespace birefit
