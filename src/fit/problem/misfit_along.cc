// What a residual holds of each unknown's own pattern (LeastSquares::misfit_along).

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fit/errors/statistics.h"
#include "fit/problem/least_squares.h"

namespace birefit::estimation {

Eigen::VectorXd LeastSquares::misfit_along(const Eigen::MatrixXd& covariance) const {
  constexpr int kSide = 16, kRings = 64;
  const Eigen::Index n = unknowns_.size();
  const auto half_waves = [](int order, int cell, int cells) {
    return std::cos(std::numbers::pi * order * (cell + 0.5) / cells);
  };
  // Modulations as columns, over the cells of a square grid or over rings. What has been absorbed most is slow: few
  // slow ones weigh it more; a misfit that follows fringes shows at the fringes' own rate.
  struct Set {
    bool rings;
    Eigen::MatrixXd modulations;
    Eigen::VectorXd found, expected;
  };
  std::vector<Set> sets;
  for (const int orders : {3, 5}) {
    Set set{false, Eigen::MatrixXd(kSide * kSide, orders * orders - 1), {}, {}};
    for (int k = 1; k < orders * orders; ++k)
      for (int cell = 0; cell < kSide * kSide; ++cell)
        set.modulations(cell, k - 1) =
            half_waves(k % orders, cell % kSide, kSide) * half_waves(k / orders, cell / kSide, kSide);
    sets.push_back(std::move(set));
  }
  Set rings{true, Eigen::MatrixXd(kRings, 24), {}, {}};
  for (int k = 0; k < 24; ++k)
    for (int ring = 0; ring < kRings; ++ring) rings.modulations(ring, k) = half_waves(k + 1, ring, kRings);
  sets.push_back(std::move(rings));
  for (Set& set : sets) set.found = set.expected = Eigen::VectorXd::Zero(n);

  for (std::size_t g = 0; g < frames_.size(); ++g) {
    const Frame& frame = frames_[g];
    const View& view = task_.picture(static_cast<int>(g)).scene.view;
    const double center_x = view.center_x_px ? view.center_x_px.in(theta_) : view.middle_x(),
                 center_y = view.center_y_px ? view.center_y_px.in(theta_) : view.middle_y();
    int left = std::numeric_limits<int>::max(), right = -1, top = left, bottom = -1;
    double farthest = 0;
    for (const auto& [x, y] : frame.set.pixels) {
      left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
      farthest = std::max(farthest, std::hypot(x - center_x, y - center_y));
    }
    if (right - left < 31 || bottom - top < 31) continue;
    Eigen::MatrixXd sum[2], squares[2];
    for (const bool of_rings : {false, true})
      sum[of_rings] = squares[of_rings] = Eigen::MatrixXd::Zero(of_rings ? kRings : kSide * kSide, n);
    for (const Tile& tile : tiles_) {
      if (tile.micrograph != static_cast<int>(g)) continue;
      const Eigen::MatrixXd influence = full_rows(tile) * covariance;
      for (Eigen::Index i = 0; i < tile.count; ++i) {
        const auto [x, y] = frame.set.pixels[static_cast<std::size_t>(tile.begin + i)];
        const int cell = (y - top) * kSide / (bottom - top + 1) * kSide + (x - left) * kSide / (right - left + 1);
        const int ring =
            std::min(kRings - 1, static_cast<int>(kRings * std::hypot(x - center_x, y - center_y) / farthest));
        const auto pull = influence.row(i) * residual_[frame.begin + tile.begin + i];
        const auto square = influence.row(i).cwiseAbs2();
        sum[0].row(cell) += pull, squares[0].row(cell) += square;
        sum[1].row(ring) += pull, squares[1].row(ring) += square;
      }
    }
    for (Set& set : sets) {
      set.found += (set.modulations.transpose() * sum[set.rings]).colwise().squaredNorm().transpose();
      set.expected += (set.modulations.cwiseAbs2().transpose() * squares[set.rings]).colwise().sum().transpose();
    }
  }
  Eigen::VectorXd factor = Eigen::VectorXd::Ones(n);
  for (const Set& set : sets) {
    // White noise stays below this in all but one of 10,000 parameters: exact errors stay exact.
    const double k = static_cast<double>(set.modulations.cols()), by_chance = chi_square_quantile(0.9999, k) / k;
    for (Eigen::Index j = 0; j < n; ++j)
      if (set.found[j] > by_chance * set.expected[j])
        factor[j] = std::max(factor[j], std::sqrt(set.found[j] / set.expected[j]));
  }
  return factor;
}

}  // namespace birefit::estimation
