#include "fit/weights/lamp.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "fit/problem/frame.h"

namespace birefit::estimation {
namespace {

/// The fit that another jitter would make, in coordinates in which the covariance of the one that there is is the unit
/// matrix: all that changes are the means' weights.
class OtherWeights {
 public:
  explicit OtherWeights(const FrameMeans& means) : means_(means) {
    const Eigen::VectorXd sd = means.covariance.diagonal().cwiseMax(0).cwiseSqrt();
    const Eigen::VectorXd inverse = sd.unaryExpr([](double s) { return s > 0 && std::isfinite(s) ? 1 / s : 0.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
        (inverse.asDiagonal() * means.covariance * inverse.asDiagonal()).eval());
    root_ = sd.asDiagonal() * solver.eigenvectors() * solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
    by_root_ = means.jacobian * root_;
  }

  struct Fit {
    double log_likelihood = 0;  ///< restricted, but for a constant
    Eigen::VectorXd shift;      ///< of all unknowns, from where the fit stands
    Eigen::VectorXd variance;   ///< of all unknowns
  };
  Fit with(double jitter) const {
    const Eigen::VectorXd weight = (1 + (jitter * means_.light.array()).square()).inverse().matrix();
    const Eigen::VectorXd change = weight - means_.weight;
    const Eigen::Index k = by_root_.cols();
    const Eigen::LLT<Eigen::MatrixXd> information(
        Eigen::MatrixXd(Eigen::MatrixXd::Identity(k, k) + by_root_.transpose() * change.asDiagonal() * by_root_));
    const Eigen::VectorXd pull = by_root_.transpose() * change.cwiseProduct(means_.residual);
    const Eigen::VectorXd step = information.solve(pull);
    Fit fit;
    const double squares = weight.dot(means_.residual.cwiseAbs2()) - pull.dot(step);
    fit.log_likelihood = 0.5 * (weight.array().log().sum() - squares) -
                         information.matrixLLT().diagonal().array().max(1e-300).log().sum();
    fit.shift = -root_ * step;
    fit.variance = information.matrixL().solve(root_.transpose()).colwise().squaredNorm().transpose();
    return fit;
  }

 private:
  const FrameMeans& means_;
  Eigen::MatrixXd root_, by_root_;
};

/// Where the integral of `density` over the places has reached half of all.
double median_place(const std::vector<double>& density) {
  std::vector<double> below{0};
  for (int i = 1; i <= kLampPlaces; ++i) {
    const auto at = static_cast<std::size_t>(i);
    below.push_back(below.back() + 0.5 * (density[at - 1] + density[at]) * (lamp_place(i) - lamp_place(i - 1)));
  }
  int i = 1;
  while (i < kLampPlaces && below[static_cast<std::size_t>(i)] < 0.5 * below.back()) ++i;
  const double from = below[static_cast<std::size_t>(i) - 1], to = below[static_cast<std::size_t>(i)];
  const double part = to > from ? (0.5 * below.back() - from) / (to - from) : 0;
  return lamp_place(i - 1) + part * (lamp_place(i) - lamp_place(i - 1));
}

}  // namespace

double lamp_place(int i) {
  constexpr double kMost = 5 * kLampJitter;
  // A frame's noise may be a millionth of its light: small jitters lie dense.
  return kMost * std::pow(static_cast<double>(i) / kLampPlaces, 3);
}

LampJitter lamp_jitter(const FrameMeans& means) {
  LampJitter found;
  found.wider = Eigen::VectorXd::Ones(means.jacobian.cols());
  const double most = means.light.maxCoeff();
  if (!(most > 0) || means.jacobian.cols() == 0) return found;  // nothing is asked of the frames
  const OtherWeights fits(means);
  std::vector<double> density;
  std::vector<OtherWeights::Fit> at;
  double top = -std::numeric_limits<double>::infinity(), likeliest = top;
  for (int i = 0; i <= kLampPlaces; ++i) {
    at.push_back(fits.with(lamp_place(i)));
    likeliest = std::max(likeliest, at.back().log_likelihood);
    density.push_back(at.back().log_likelihood - 0.5 * std::pow(lamp_place(i) / kLampJitter, 2));
    top = std::max(top, density.back());
  }
  for (double& d : density) d = std::exp(d - top);

  // Twice the logarithm is half a chi-square of one degree of freedom where there is no jitter, the other half zero: a
  // twentieth is beyond this, and of few frames a fiftieth (measured).
  constexpr double kShown = 2.7;
  found.shown = 2 * (likeliest - at.front().log_likelihood) > kShown;
  // Frames that agree to their noise are not asked what else their lamp may do: where they do not show a jitter, that
  // widens the error of the brightest frame's mean by kUnseen, and no parameter's by more than kWidened in all.
  constexpr double kUnseen = 1.2, kWidened = 1.28;
  found.share = median_place(density);
  if (!found.shown) found.share = std::min(found.share, std::sqrt(kUnseen * kUnseen - 1) / most);

  const OtherWeights::Fit used = fits.with(found.share);
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(found.wider.size());
  double whole = 0;
  for (int i = 0; i <= kLampPlaces; ++i) {
    const OtherWeights::Fit& fit = at[static_cast<std::size_t>(i)];
    const double before = lamp_place(std::max(i - 1, 0)), after = lamp_place(std::min(i + 1, kLampPlaces));
    const double share = density[static_cast<std::size_t>(i)] * (after - before);
    whole += share;
    variance += share * (fit.variance + (fit.shift - used.shift).cwiseAbs2());
  }
  for (Eigen::Index j = 0; j < variance.size(); ++j) {
    const double by_one = used.variance[j];
    double all = variance[j] / whole;
    if (!found.shown) all = std::min(all, kWidened * kWidened * at.front().variance[j]);
    if (by_one > 0 && std::isfinite(all)) found.wider[j] = std::sqrt(std::max(1.0, all / by_one));
  }
  return found;
}

}  // namespace birefit::estimation
