#include "instrument/channels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Dense>

namespace birefit {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// The Gauss-Legendre rule of four points on [0, 1].
constexpr std::array<double, 4> kPoint{0.06943184420297371, 0.33000947820757187, 0.6699905217924281,
                                       0.9305681557970262};
constexpr std::array<double, 4> kShare{0.17392742256872692, 0.3260725774312731, 0.3260725774312731,
                                       0.17392742256872692};
constexpr double kLongestPieceUm = 0.001;
/// Four points leave 1e-10 of an oscillation that goes this far (rad) within a piece.
constexpr double kPhaseOfPiece = 1.5;
/// More than any known dispersion of a retardance in the visible, against 589 nm.
constexpr double kDispersion = 1.5;

using Range = std::pair<double, double>;
Range overlap(const Range& a, const Range& b) { return {std::max(a.first, b.first), std::min(a.second, b.second)}; }
bool empty(const Range& range) { return !(range.first < range.second); }

double product_at(const std::vector<const Spectrum*>& factors, double l) {
  double product = 1;
  for (const Spectrum* factor : factors) product *= value_at(*factor, l);
  return product;
}
Range common_range(const std::vector<const Spectrum*>& factors) {
  Range range{0, kInfinite};
  for (const Spectrum* factor : factors) range = overlap(range, range_of(*factor));
  return range;
}

/// Pieces of a range on which a product of spectra is smooth: their ends. Where nothing bounds the range, it is cut
/// where the microscope's own range ends.
std::vector<double> pieces(const std::vector<const Spectrum*>& factors, Range range, double reach_um) {
  range = overlap(range, {0.1, 20});
  if (empty(range)) return {};
  double smooth = kLongestPieceUm;
  std::vector<double> ends{range.first, range.second};
  for (const Spectrum* factor : factors) {
    smooth = std::min(smooth, smooth_length(*factor));
    for (const double kink : kinks_of(*factor))
      if (kink > range.first && kink < range.second) ends.push_back(kink);
  }
  std::sort(ends.begin(), ends.end());
  // Tables that share their entries differ by rounding: no piece is that short.
  constexpr double kSame = 1e-9;
  std::vector<double> all{ends.front()};
  for (const double end : ends) {
    const double from = all.back(), length = end - from;
    if (length < kSame) continue;
    const double turn = kPhaseOfPiece * from * from / (2 * std::numbers::pi * kDispersion * std::max(reach_um, 1e-3));
    // a nanometre by rounding is one piece
    const int count = static_cast<int>(std::ceil(length / std::min(smooth, turn) - 1e-6));
    for (int i = 1; i < count; ++i) all.push_back(from + length * i / count);
    all.push_back(end);
  }
  return all;
}

double integral_of(const std::vector<const Spectrum*>& factors, const Range& range) {
  const std::vector<double> ends = pieces(factors, range, 1);
  double sum = 0;
  for (std::size_t i = 0; i + 1 < ends.size(); ++i)
    for (std::size_t k = 0; k < kPoint.size(); ++k)
      sum += kShare[k] * (ends[i + 1] - ends[i]) * product_at(factors, ends[i] + kPoint[k] * (ends[i + 1] - ends[i]));
  return sum;
}

double total(const std::vector<double>& x) { return std::accumulate(x.begin(), x.end(), 0.0); }

}  // namespace

std::vector<double> SpectralSum::of(const std::function<double(double)>& intensity) const {
  std::vector<double> result(channels(), 0.0);
  for (std::size_t k = 0; k < size(); ++k) {
    const double here = intensity(wavelength_um[k]);
    for (std::size_t c = 0; c < channels(); ++c) result[c] += weight[c][k] * here;
  }
  return result;
}

Channels::Channels(Spectrum lamp, std::vector<Spectrum> filters, std::vector<Spectrum> sensitivities,
                   const Where& where)
    : light_{std::move(lamp)}, sensitivities_(std::move(sensitivities)), range_{kInfinite, 0} {
  if (sensitivities_.empty()) throw std::logic_error("Channels: none");
  light_.insert(light_.end(), std::make_move_iterator(filters.begin()), std::make_move_iterator(filters.end()));
  Problems problems;
  const auto check = [&](const Spectrum& spectrum, const std::string& name) {
    try {
      check_spectrum(spectrum, where, name);
    } catch (const UserError& error) {
      problems.add(error);
    }
  };
  const auto name = [](std::size_t i) { return i == 0 ? std::string("lamp") : fmt::format("filter{}", i); };
  for (std::size_t i = 0; i < light_.size(); ++i) {
    check(light_[i], i == 0 ? "the lamp" : fmt::format("filter {}", i));
    first_.push_back(numbers_.size());
    for (const std::string& number : numbers_of(light_[i])) numbers_.push_back(name(i) + "." + number);
  }
  first_.push_back(numbers_.size());
  for (std::size_t c = 0; c < sensitivities_.size(); ++c) check(sensitivities_[c], fmt::format("channel {}", c + 1));
  problems.throw_if_any();
  check_cover(where);
  const SpectralSum sum = integral(1);
  for (const std::vector<double>& w : sum.weight) white_.push_back(total(w));
}

void Channels::check_cover(const Where& where) {
  Problems problems;
  for (std::size_t c = 0; c < sensitivities_.size(); ++c) {
    std::vector<const Spectrum*> all{&sensitivities_[c]};
    for (const Spectrum& light : light_) all.push_back(&light);
    const Range range = common_range(all);
    const bool bounded = std::isfinite(range.second);
    const bool passes = bounded && !empty(range) && integral_of(all, range) > 0;
    if (!bounded)
      problems.add(where, fmt::format("neither the light nor the sensitivity of channel {} ends anywhere", c + 1),
                   "give one of them as a table, a line or a band");
    else if (!passes)
      problems.add(where,
                   fmt::format("channel {} records nothing: lamp, filters and sensitivity do not overlap", c + 1));
    if (!passes) continue;
    range_ = {std::min(range_.first, range.first), std::max(range_.second, range.second)};
    for (std::size_t f = 0; f < light_.size(); ++f) {
      if (!std::holds_alternative<SpectralTable>(light_[f])) continue;
      std::vector<const Spectrum*> others;
      for (const Spectrum* factor : all)
        if (factor != &light_[f]) others.push_back(factor);
      const Range known = range_of(light_[f]), asked = common_range(others);
      const double share = (integral_of(others, {asked.first, std::min(asked.second, known.first)}) +
                            integral_of(others, {std::max(asked.first, known.second), asked.second})) /
                           integral_of(others, asked);
      if (share > kUncovered)
        problems.add(
            where,
            fmt::format("{} is known from {:.4g} to {:.4g} um only: {:.2g} % of what channel {} sees lies outside",
                        f == 0 ? std::string("the lamp") : fmt::format("filter {}", f), known.first, known.second,
                        100 * share, c + 1),
            fmt::format("the channel sees {:.4g} to {:.4g} um", asked.first, std::min(asked.second, 20.0)));
    }
  }
  problems.throw_if_any();
}

void Channels::add(double l, double share, SpectralSum& sum) const {
  const std::size_t factors = light_.size();
  std::vector<double> value(factors);
  for (std::size_t f = 0; f < factors; ++f) value[f] = value_at(light_[f], l);
  // of the light by its numbers, without the sensitivity
  std::vector<double> slope(numbers_.size());
  double light = share;
  for (std::size_t f = 0; f < factors; ++f) {
    light *= value[f];
    if (first_[f] == first_[f + 1]) continue;
    slopes_at(light_[f], l, &slope[first_[f]]);
    double others = share;
    for (std::size_t g = 0; g < factors; ++g)
      if (g != f) others *= value[g];
    for (std::size_t i = first_[f]; i < first_[f + 1]; ++i) slope[i] *= others;
  }
  sum.wavelength_um.push_back(l);
  sum.weight.resize(sensitivities_.size());
  sum.slope.resize(numbers_.size(), std::vector<std::vector<double>>(sensitivities_.size()));
  for (std::size_t c = 0; c < sensitivities_.size(); ++c) {
    const double seen = value_at(sensitivities_[c], l);
    sum.weight[c].push_back(light * seen);
    for (std::size_t i = 0; i < slope.size(); ++i) sum.slope[i][c].push_back(slope[i] * seen);
  }
}

void Channels::scale(SpectralSum& sum) {
  for (std::size_t c = 0; c < sum.channels(); ++c) {
    std::vector<double>& w = sum.weight[c];
    const double inverse = 1 / total(w);
    for (double& x : w) x *= inverse;
    for (auto& number : sum.slope) {
      const double change = total(number[c]) * inverse;
      for (std::size_t k = 0; k < w.size(); ++k) number[c][k] = number[c][k] * inverse - w[k] * change;
    }
  }
}

SpectralSum Channels::integral(double reach_um) const {
  std::vector<const Spectrum*> all;
  for (const std::vector<Spectrum>* part : {&light_, &sensitivities_})
    for (const Spectrum& spectrum : *part) all.push_back(&spectrum);
  const std::vector<double> ends = pieces(all, range_, reach_um);
  SpectralSum sum;
  for (std::size_t i = 0; i + 1 < ends.size(); ++i)
    for (std::size_t k = 0; k < kPoint.size(); ++k) {
      const double length = ends[i + 1] - ends[i];
      add(ends[i] + kPoint[k] * length, kShare[k] * length, sum);
    }
  return sum;
}

SpectralSum Channels::fine(double reach_um) const {
  SpectralSum sum = integral(reach_um);
  scale(sum);
  return sum;
}

SpectralSum Channels::uniform(int n) const {
  if (n < 1) throw std::logic_error("Channels::uniform: no wavelength");
  const double from = 1 / range_.second, step = (1 / range_.first - from) / n;
  SpectralSum sum;
  for (int i = n; i-- > 0;) {
    const double l = 1 / (from + (i + 0.5) * step);
    add(l, l * l, sum);  // dl = -l^2 d(1/l)
  }
  for (const std::vector<double>& w : sum.weight)
    if (!(total(w) > 0)) throw std::logic_error("Channels::uniform: a channel lies between the wavelengths");
  scale(sum);
  return sum;
}

SpectralSum gauss_sum(const SpectralSum& fine, int n) {
  using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;
  const Index points = static_cast<Index>(fine.size());
  if (n < 1 || n > points / 4) throw std::logic_error("gauss_sum: more nodes than the finer sum can tell");
  // The measure: all channels together at each point's 1/wavelength, which is moved to [-1, 1].
  VectorXd root(points), x(points);
  const double low = 1 / fine.wavelength_um.back(), high = 1 / fine.wavelength_um.front();
  for (Index k = 0; k < points; ++k) {
    const std::size_t at = static_cast<std::size_t>(k);
    double sum = 0;
    for (const std::vector<double>& w : fine.weight) sum += w[at];
    root(k) = std::sqrt(sum);
    x(k) = (2 / fine.wavelength_um[at] - low - high) / (high - low);
  }
  // Lanczos: columns q_j(k) = p_j(x_k) root_k, p_j the orthonormal polynomials; each is made orthogonal to all before,
  // twice, since the recurrence alone forgets them.
  MatrixXd q(points, n);
  VectorXd diagonal(n), below(std::max(n - 1, 1));
  const double norm = root.norm();
  q.col(0) = root / norm;
  for (Index j = 0; j < n; ++j) {
    VectorXd next = x.cwiseProduct(q.col(j));
    diagonal(j) = next.dot(q.col(j));
    if (j + 1 == n) break;
    for (int pass = 0; pass < 2; ++pass) next -= q.leftCols(j + 1) * (q.leftCols(j + 1).transpose() * next);
    below(j) = next.norm();
    q.col(j + 1) = next / below(j);
  }
  Eigen::SelfAdjointEigenSolver<MatrixXd> jacobi;
  jacobi.computeFromTridiagonal(diagonal, below.head(n - 1));
  const MatrixXd& v = jacobi.eigenvectors();  // v(j, i) = p_j(x_i) sqrt(Gauss weight of i)
  SpectralSum rule;
  for (Index i = n; i-- > 0;) rule.wavelength_um.push_back(2 / (low + high + (high - low) * jacobi.eigenvalues()(i)));
  // The polynomial that is 1 at node i and 0 at the others is the sum over j of (Gauss weight of i) p_j(x_i) p_j(x).
  const auto onto_nodes = [&](const std::vector<double>& row) {
    VectorXd over(points);
    for (Index k = 0; k < points; ++k) over(k) = root(k) > 0 ? row[static_cast<std::size_t>(k)] / root(k) : 0.0;
    const VectorXd moments = q.transpose() * over;
    const VectorXd weights = norm * v.row(0).transpose().cwiseProduct(v.transpose() * moments);
    std::vector<double> out;
    for (Index i = n; i-- > 0;) out.push_back(weights(i));
    return out;
  };
  for (const std::vector<double>& row : fine.weight) rule.weight.push_back(onto_nodes(row));
  rule.slope.resize(fine.slope.size());
  for (std::size_t p = 0; p < fine.slope.size(); ++p)
    for (const std::vector<double>& row : fine.slope[p]) rule.slope[p].push_back(onto_nodes(row));
  return rule;
}

double cycles_per_um(const SpectralSum& sum, const std::vector<double>& t) {
  if (t.size() != sum.size()) throw std::logic_error("cycles_per_um: t is not of the sum's wavelengths");
  // The share of all channels left out at either end: what is between is 394 to 695 nm of the CIE's observer under E.
  constexpr double kEnds = 0.001;
  std::vector<double> together(sum.size(), 0.0);
  for (const std::vector<double>& w : sum.weight)
    for (std::size_t k = 0; k < w.size(); ++k) together[k] += w[k];
  const double all = total(together);
  const auto place = [&](double share) {
    double passed = 0;
    std::size_t k = 0;
    while (k + 1 < together.size() && passed + together[k] < share * all) passed += together[k++];
    return t[k];
  };
  return std::abs(place(kEnds) - place(1 - kEnds));
}

int gauss_nodes(double cycles, double error) {
  // Decades below 1e-3, d. Beyond 14 cycles most of the fringes have gone from the channels.
  const double d = std::clamp(-3 - std::log10(error), 0.0, 3.0);
  const double seen = std::min(cycles, 14.0), gone = cycles - seen;
  return static_cast<int>(std::ceil(7 + 5 * d + (3.8 + 0.5 * d) * seen + (2.4 + d * (0.65 + 0.25 * d)) * gone));
}
int line_nodes(double phase_deviation) {
  const double s = phase_deviation;
  return static_cast<int>(std::ceil(2 + s * (3 + 0.2 * s)));
}
int uniform_nodes(double cycles) { return static_cast<int>(std::ceil(42 + 1.6 * cycles)); }

double difference(const SpectralSum& a, const SpectralSum& b, const std::function<double(double)>& intensity) {
  const std::vector<double> of_a = a.of(intensity), of_b = b.of(intensity);
  double worst = 0;
  for (std::size_t c = 0; c < of_a.size(); ++c) worst = std::max(worst, std::abs(of_a[c] - of_b.at(c)));
  return worst;
}

}  // namespace birefit
