// Distributions by Boost.Math, in a file of its own: its headers take seconds to read.

#include <cmath>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "fit/errors/statistics.h"

namespace birefit::estimation {
namespace {

namespace math = boost::math;
/// What has no value is not a number, and what is beyond all numbers infinite, as in the rest of the program.
using Quiet = math::policies::policy<math::policies::domain_error<math::policies::ignore_error>,
                                     math::policies::overflow_error<math::policies::ignore_error>>;
using Normal = math::normal_distribution<double, Quiet>;
using StudentT = math::students_t_distribution<double, Quiet>;
using ChiSquare = math::chi_squared_distribution<double, Quiet>;

/// More degrees of freedom are normal to rounding.
bool is_normal(double dof) { return !(dof < 1e8); }

}  // namespace

double normal_cdf(double x) { return math::cdf(Normal(), x); }

double normal_quantile(double probability) { return math::quantile(Normal(), probability); }

double student_t_cdf(double t, double dof) { return is_normal(dof) ? normal_cdf(t) : math::cdf(StudentT(dof), t); }

double student_t_quantile(double probability, double dof) {
  return is_normal(dof) ? normal_quantile(probability) : math::quantile(StudentT(dof), probability);
}

double chi_square_quantile(double probability, double dof) { return math::quantile(ChiSquare(dof), probability); }

}  // namespace birefit::estimation
