#include "fit/errors/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/sub_grid.h"

namespace birefit::estimation {
TallQr::TallQr(int columns) : factor_(Eigen::MatrixXd::Zero(columns, columns)) {}

void TallQr::add(const Eigen::MatrixXd& rows) {
  const Eigen::Index n = factor_.cols();
  if (n == 0) return;
  Eigen::MatrixXd stacked(n + rows.rows(), n);
  stacked.topRows(n) = factor_;
  stacked.bottomRows(rows.rows()) = rows;
  const Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(stacked);
  factor_ = qr.matrixQR().topRows(n).triangularView<Eigen::Upper>();
}

Inverse invert_normal_equations(const Eigen::MatrixXd& factor) {
  // Below this ratio of singular values a direction is not seen: rounding alone moves unit columns by 1e-16 times the
  // square root of the number of rows, while a correlation of 0.999998 gives 1e-3.
  constexpr double kUnseen = 1e-7;
  const int n = static_cast<int>(factor.cols());
  Inverse result;
  result.covariance = Eigen::MatrixXd::Zero(n, n);
  result.no_influence.assign(n, false);
  result.undetermined.assign(n, false);
  result.conditional_sd = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  std::vector<int> kept;
  for (int j = 0; j < n; ++j) {
    const double norm = factor.col(j).norm();
    if (norm > 0 && std::isfinite(norm)) {
      kept.push_back(j);
      result.conditional_sd[j] = 1 / norm;
    } else {
      result.no_influence[j] = result.undetermined[j] = true;
    }
  }
  if (kept.empty()) return result;
  const int k = static_cast<int>(kept.size());
  Eigen::MatrixXd unit(n, k);
  for (int j = 0; j < k; ++j) unit.col(j) = factor.col(kept[j]) * result.conditional_sd[kept[j]];
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(unit, Eigen::ComputeThinV);
  const Eigen::VectorXd& sigma = svd.singularValues();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(k, k);  // covariance of the unit columns = root root^T
  for (int i = 0; i < k; ++i) {
    if (sigma[i] > kUnseen * sigma[0]) {
      root.col(i) = svd.matrixV().col(i) / sigma[i];
      continue;
    }
    for (int j = 0; j < k; ++j)
      if (std::abs(svd.matrixV()(j, i)) > 1e-3) result.undetermined[kept[j]] = true;
  }
  const Eigen::MatrixXd covariance = root * root.transpose();
  for (int i = 0; i < k; ++i)
    for (int j = 0; j < k; ++j)
      result.covariance(kept[i], kept[j]) =
          covariance(i, j) * result.conditional_sd[kept[i]] * result.conditional_sd[kept[j]];
  return result;
}

double correlation_area(const Image& whitened, const Mask& mask) {
  if (const SubGrid grid = sub_grid(mask); grid.spacing > 1)
    return correlation_area(on_grid(whitened, grid), on_grid(mask, grid));
  const int width = whitened.width(), height = whitened.height();
  // Enough rows for a correlation known to 0.01; more of a large image adds time only.
  const int row_step = std::max(1, static_cast<int>(whitened.size() / 400000));
  double variance = 0, used = 0;
  for (int y = 0; y < height; y += row_step)
    for (int x = 0; x < width; ++x)
      if (mask(x, y)) variance += whitened(x, y) * whitened(x, y), ++used;
  if (!(variance > 0)) return 1;
  variance /= used;
  const auto correlation = [&](int dx, int dy) {
    double sum = 0, pairs = 0;
    for (int y = 0; y + dy < height; y += row_step) {
      const double* a = whitened.row(y);
      const double* b = whitened.row(y + dy);
      const std::uint8_t* ma = mask.row(y);
      const std::uint8_t* mb = mask.row(y + dy);
      for (int x = std::max(0, -dx); x < std::min(width, width - dx); ++x) {
        const double both = ma[x] & mb[x + dx];
        sum += both * a[x] * b[x + dx];
        pairs += both;
      }
    }
    return pairs > 0 ? sum / pairs / variance : 0.0;
  };
  const double floor = std::max(0.05, 3 / std::sqrt(used));
  // A misfit longer than a third of the image cannot be told from a trend; its area is limited to what fits.
  const auto reach = [&](bool along_x) {
    const int limit = std::max(1, (along_x ? width : height) / 3);
    int lag = 1;
    while (lag < limit && correlation(along_x ? lag : 0, along_x ? 0 : lag) > floor) lag += std::max(1, lag / 4);
    return std::min(lag, limit);
  };
  const int reach_x = reach(true), reach_y = reach(false);
  const int step_x = std::max(1, reach_x / 8), step_y = std::max(1, reach_y / 8);
  double area = 0;
  for (int dy = 0; dy <= reach_y; dy += step_y)
    for (int dx = -reach_x / step_x * step_x; dx <= reach_x; dx += step_x) {
      if (dy == 0 && dx < 0) continue;
      if (dx == 0 && dy == 0) continue;
      const double rho = correlation(dx, dy);
      if (rho > floor) area += 2 * rho;
    }
  // A single pixel's own variance counts once, not once per lag step.
  return 1 + area * step_x * step_y;
}

}  // namespace birefit::estimation
