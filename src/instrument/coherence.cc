#include "instrument/coherence.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
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

Coherence::WithSlope<double> Coherence::sum(std::size_t row, double g) const {
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

Coherence::WithSlope<double> Coherence::values(std::size_t row, double g) const {
  const double size = std::abs(g), place = size / width_;
  if (!(place < static_cast<double>(panels_))) return sum(row, g);
  const std::size_t p = static_cast<std::size_t>(place);
  const Panel& panel = panel_[row * panels_ + p];
  const double x = p == 0 ? 2 * place * place - 1 : 2 * (place - static_cast<double>(p)) - 1;
  double loss = 0, im = 0, loss_slope = 0, im_slope = 0;
  for (std::size_t c = kPoints; c-- > 0;) {
    loss_slope = loss_slope * x + loss;
    im_slope = im_slope * x + im;
    loss = loss * x + panel.power[c][0];
    im = im * x + panel.power[c][1];
  }
  if (p == 0) {
    // x = 2 (g/width)^2 - 1
    const double dx = 4 * g / (width_ * width_);
    return {g * g * loss, g * im, 2 * g * loss + g * g * loss_slope * dx, im + g * im_slope * dx};
  }
  const double scale = 2 / width_, sign = g < 0 ? -1 : 1;
  return {loss, sign * im, sign * loss_slope * scale, im_slope * scale};
}

Coherence::WithSlope<Pack> Coherence::values(std::size_t row, const Pack& g) const {
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
  const C z(1, -s2 * phase.d2), m = C(0, s2 * phase.d1) / z, u = s2 / z;
  const double envelope = std::abs(std::exp(-0.5 * s2 * phase.d1 * phase.d1 / z) / std::sqrt(z));
  const C fourth = m * m * m * m + 6.0 * m * m * u + 3.0 * u * u;
  // <y^6> of the square of the third order; d4 is about -4 d3, that of a path difference without dispersion.
  const C m2 = m * m, sixth = m2 * m2 * m2 + 15.0 * m2 * m2 * u + 45.0 * m2 * u * u + 15.0 * u * u * u;
  return 0.5 * envelope *
         (std::abs(phase.d3 / 6 * (phase.d3 / 6) * sixth) * 0.5 + std::abs(4 * phase.d3 / 24 * fourth));
}

}  // namespace birefit
