#include "birefit/combine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fit/errors/statistics.h"

namespace birefit {
namespace {

/// Picks the named parameters out of a vector of all: rows of the unit matrix; no rows when one is missing.
Eigen::MatrixXd selection(const std::vector<std::string>& in, const std::vector<std::string>& names) {
  Eigen::MatrixXd pick = Eigen::MatrixXd::Zero(std::ssize(names), std::ssize(in));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = std::find(in.begin(), in.end(), names[i]);
    if (found == in.end()) return Eigen::MatrixXd(0, std::ssize(in));
    pick(static_cast<Eigen::Index>(i), found - in.begin()) = 1;
  }
  return pick;
}

/// Scaled to unit diagonal on the way, so that parameters of very different size do not hide a lost direction.
std::optional<Eigen::MatrixXd> inverse(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sd = covariance.diagonal().cwiseSqrt();
  if (!covariance.allFinite() || !(sd.minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd per = sd.cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> solver(per.asDiagonal() * covariance * per.asDiagonal());
  if (solver.info() != Eigen::Success) return std::nullopt;
  return per.asDiagonal() * solver.solve(Eigen::MatrixXd::Identity(sd.size(), sd.size())) * per.asDiagonal();
}

}  // namespace

std::optional<Posterior> marginal(const Posterior& all, const std::vector<std::string>& names) {
  const Eigen::MatrixXd pick = selection(all.names, names);
  if (pick.rows() == 0 || !all.mean.allFinite() || !all.covariance.allFinite()) return std::nullopt;
  Posterior one{names, pick * all.mean, pick * all.covariance * pick.transpose(), all.degrees_of_freedom};
  return inverse(one.covariance) ? std::optional<Posterior>(std::move(one)) : std::nullopt;
}

/// Given the shared parameters s, the fits are independent: p(s | all) ~ prior(s) prod_i L_i(s), where L_i, the
/// likelihood of fit i with its own parameters integrated out, is its marginal posterior over the prior. For Gaussians
/// informations and information times mean add (Bishop, Pattern Recognition and Machine Learning, 2006,
/// eqs. 2.113-2.117). Per fit, in coordinates in which the posterior is a unit Gaussian, the eigenvalues of the prior's
/// information say what fraction of each direction is not the fit's own.
SharedEstimate combine(const std::vector<Posterior>& fits, const std::optional<Posterior>& prior) {
  SharedEstimate shared;
  const Eigen::Index q = fits.front().mean.size();
  Eigen::MatrixXd prior_information = Eigen::MatrixXd::Zero(q, q);
  Eigen::VectorXd prior_mean = Eigen::VectorXd::Zero(q);
  // In units of the first fit's standard errors, for the solvers' sake.
  const Eigen::VectorXd unit = fits.front().covariance.diagonal().cwiseSqrt();
  const auto information_of = [&](const Posterior& p) -> Eigen::MatrixXd {
    return unit.asDiagonal() * inverse(p.covariance).value() * unit.asDiagonal();
  };
  if (prior) {
    const Eigen::MatrixXd spread = selection(fits.front().names, prior->names).transpose();
    prior_information =
        unit.asDiagonal() * (spread * inverse(prior->covariance).value() * spread.transpose()) * unit.asDiagonal();
    prior_mean = (spread * prior->mean).cwiseQuotient(unit);
  }

  /// What a fit adds: `own[k]` of the information in coordinate k of axes * x, and there own[k] times its value.
  struct Data {
    Eigen::MatrixXd axes;
    Eigen::VectorXd own, weighted;
  };
  std::vector<Data> data;
  Eigen::MatrixXd information = prior_information;
  Eigen::VectorXd sum = prior_information * prior_mean;
  double degrees = prior ? prior->degrees_of_freedom : std::numeric_limits<double>::infinity();
  for (const Posterior& fit : fits) {
    const Eigen::MatrixXd lower = information_of(fit).llt().matrixL();
    const Eigen::MatrixXd half = lower.triangularView<Eigen::Lower>().solve(prior_information);
    const Eigen::MatrixXd share = lower.triangularView<Eigen::Lower>().solve(half.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (share + share.transpose()));
    Data d;
    d.axes = eigen.eigenvectors().transpose() * lower.transpose();
    d.own = (1 - eigen.eigenvalues().array()).cwiseMax(0).cwiseMin(1);
    d.weighted = d.axes * fit.mean.cwiseQuotient(unit) - (1 - d.own.array()).matrix().cwiseProduct(d.axes * prior_mean);
    information += d.axes.transpose() * d.own.asDiagonal() * d.axes;
    sum += d.axes.transpose() * d.weighted;
    degrees = std::min(degrees, fit.degrees_of_freedom);
    data.push_back(std::move(d));
  }
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd mean = solver.solve(sum);
  const Eigen::MatrixXd covariance = solver.solve(Eigen::MatrixXd::Identity(q, q));
  shared.posterior = {fits.front().names, mean.cwiseProduct(unit), unit.asDiagonal() * covariance * unit.asDiagonal(),
                      degrees};
  shared.fits = static_cast<int>(fits.size());

  // Directions of which a fit tells next to nothing beyond the prior are no observations.
  constexpr double kTold = 0.01;
  for (const Data& d : data) {
    const Eigen::VectorXd common = d.axes * mean;
    for (Eigen::Index k = 0; k < q; ++k)
      if (d.own[k] > kTold) {
        shared.chi_square += d.own[k] * std::pow(d.weighted[k] / d.own[k] - common[k], 2);
        ++shared.chi_square_degrees;
      }
  }
  if (prior) {
    shared.chi_square += (prior_mean - mean).dot(prior_information * (prior_mean - mean));
    shared.chi_square_degrees += static_cast<int>(prior->mean.size());
  }
  shared.chi_square_degrees = std::max(0, shared.chi_square_degrees - static_cast<int>(q));
  constexpr double kByChance = 0.999;
  shared.consistent = shared.chi_square_degrees == 0 ||
                      shared.chi_square <= estimation::chi_square_quantile(kByChance, shared.chi_square_degrees);
  // Fits that disagree have errors nobody stated: what is common to all is scaled by what they miss each other by
  // (Birge, Phys. Rev. 40, 207 (1932); the scale factor of the Particle Data Group), and known from that many
  // observations.
  if (!shared.consistent) {
    shared.posterior.covariance *= shared.chi_square / shared.chi_square_degrees;
    shared.posterior.degrees_of_freedom = std::min<double>(degrees, shared.chi_square_degrees);
  }
  return shared;
}

/// Given s, the other fits say nothing of this one's own parameters: p(all of them | all fits) = p(s | all fits) p(own
/// | s, this fit). With K = cov(all, s) C_ss^-1 (Bishop, eqs. 2.81-2.82) the mean moves by K times what s moves, and K
/// (C_ss - V) K^T of the covariance is gone, V being that of s by all fits; in the rows of s itself K is the unit
/// matrix.
Posterior informed(const Posterior& fit, const SharedEstimate& shared) {
  const Eigen::MatrixXd pick = selection(fit.names, shared.posterior.names);
  const Eigen::MatrixXd alone = pick * fit.covariance * pick.transpose();
  const Eigen::MatrixXd gain = fit.covariance * pick.transpose() * inverse(alone).value();
  Posterior result = fit;
  result.degrees_of_freedom = shared.posterior.degrees_of_freedom;
  result.mean += gain * (shared.posterior.mean - pick * fit.mean);
  result.covariance -= gain * (alone - shared.posterior.covariance) * gain.transpose();
  return result;
}

double interval95_factor(double degrees_of_freedom) {
  return estimation::student_t_quantile(0.975, degrees_of_freedom);
}

}  // namespace birefit
