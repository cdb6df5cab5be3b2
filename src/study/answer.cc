#include "study/answer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "study/rays.h"
#include "transport/methods.h"
#include "transport/methods/ode_operator.h"
#include "transport/methods/ode_scalar.h"
#include "transport/methods/wei_norman.h"
#include "transport/modes.h"

namespace birefit::study {

double frobenius(const Mat2<double>& m) { return std::sqrt(norm(m.a) + norm(m.b) + norm(m.c) + norm(m.d)); }
double relative_distance(const Mat2<double>& m, const Mat2<double>& reference) {
  return frobenius(m - reference) / frobenius(reference);
}
bool finite(const Mat2<double>& m) { return std::isfinite(frobenius(m)); }

namespace {

/// Rounding of a product of `steps` matrices.
double rounding(int steps) { return 4e-16 * (16 + steps); }
Answer refused(const std::string& why, double samples) {
  return {Mat2<double>::identity(), std::numeric_limits<double>::infinity(), samples, why};
}
Mat2<double> response(const TransportMethod<double>& method, const Question& q, const Mesh& mesh) {
  return q.host_index > 0 ? method.transmission(q.column, q.ray, mesh, q.host_index)
                          : method.transfer(q.column, q.ray, mesh);
}

}  // namespace

Answer by_halving(const TransportMethod<double>& method, const Question& question, double tolerance, int most) {
  const CountingColumn<double> counted(question.column);
  const Question asked{counted, question.ray, question.host_index};
  // Steps too long for the method are refused by the method: no answer yet.
  const auto with_steps = [&](int n) {
    try {
      return response(method, asked, uniform_mesh(n, counted.breaks));
    } catch (const std::domain_error&) {
      return Mat2<double>{std::numeric_limits<double>::quiet_NaN(), 0, 0, 0};
    }
  };
  const double falls = method.info().order > 0 ? std::exp2(0.5 * method.info().order) : 2;
  Mat2<double> before = with_steps(16);
  double last_change = std::numeric_limits<double>::infinity();
  for (int n = 32; n <= most; n *= 2) {
    const Mat2<double> now = with_steps(n);
    const double change =
        finite(now) && finite(before) ? relative_distance(before, now) : std::numeric_limits<double>::infinity();
    const bool converging = last_change >= falls * change || change < rounding(n);
    // Falling by `falls` a halving from here on, what is left is at most change/(falls - 1).
    if (change <= tolerance && converging && std::isfinite(last_change))
      return {now, 2 * change / (falls - 1) + rounding(n), counted.count(), ""};
    last_change = change;
    before = now;
  }
  return refused("has not converged in " + std::to_string(most) + " steps", counted.count());
}

Answer diagonal_answer(const Question& question, double tolerance) {
  const Column<double>& column = question.column;
  const Ray<double>& ray = question.ray;
  Answer answer = by_halving(Diagonal<double>(), question, tolerance, 1024);
  if (!answer.flag.empty()) return answer;
  const auto at = [&](double u) {
    OpticalPoint<double> p;
    column.sample({&u, 1}, &p);
    return p;
  };
  if (modes_turn_over(at, ray, 0, 1, 512))
    return refused("the axis passes the wavevector, where the modes change places", answer.samples);
  // To first order the other mode receives int b e^{-+2 g3}: at most |b/2b3| at both ends and its variation between
  // them.
  constexpr int kNodes = 256;
  double reach = 0, variation = 0;
  Complex<double> last[2];
  for (int i = 0; i <= kNodes; ++i) {
    const double u[1] = {std::clamp(static_cast<double>(i) / kNodes, 1e-9, 1 - 1e-9)};
    OpticalPoint<Slope<double>> p;
    column.sample_with_slope(u, &p);
    for (double* slope : {&p.axis.x.d[0], &p.axis.y.d[0], &p.axis.z.d[0], &p.ordinary.d[0], &p.extraordinary.d[0],
                          &p.ordinary_im.d[0], &p.extraordinary_im.d[0]})
      *slope /= p.depth_slope_um.value;  // by depth
    const auto g = modal_generator(p, ray);
    const Complex<double> ratio[2] = {0.5 * (g.b1 / g.b3), 0.5 * (g.b2 / g.b3)};
    for (int k = 0; k < 2; ++k) {
      const double size = std::sqrt(norm(ratio[k]));
      if (!std::isfinite(size)) return refused("the modes are not defined everywhere", answer.samples);
      if (i == 0 || i == kNodes) reach += size;
      if (i > 0) variation += std::sqrt(norm(ratio[k] - last[k]));
      last[k] = ratio[k];
    }
  }
  const double coupling = 2 * (reach + variation);
  if (coupling > 0.5) return refused("modes couple strongly", answer.samples);
  answer.estimate += coupling;
  return answer;
}

Answer modal_answer(const Question& question, double tolerance) {
  const Column<double>& column = question.column;
  const Ray<double>& ray = question.ray;
  if (column.jumps) return refused("the medium jumps", 0);
  const CountingColumn<double> counted(column);
  const auto at = [&](double u) {
    OpticalPoint<double> p;
    column.sample({&u, 1}, &p);
    return p;
  };
  if (modes_turn_over(at, ray, 0, 1, 512))
    return refused("the axis passes the wavevector, where the modes change places", 513);
  Mat2<double> before;
  for (int n = 1; n <= 1024; n *= 2) {
    const Mesh mesh = uniform_mesh(n, column.breaks);
    constexpr int kPasses = Modal<double>::kPasses;
    const auto with_passes = [&](const Column<double>& medium, int passes) {
      try {
        return response(Modal<double>(passes), {medium, ray, question.host_index}, mesh);
      } catch (const std::domain_error&) {
        return Mat2<double>{std::numeric_limits<double>::quiet_NaN(), 0, 0, 0};
      }
    };
    const Mat2<double> now = with_passes(counted, kPasses);
    if (n > 1 && finite(now) && finite(before)) {
      const double change = relative_distance(before, now);
      const Mat2<double> less = with_passes(column, kPasses - 1), least = with_passes(column, kPasses - 2);
      const double last = relative_distance(less, now), one_before = relative_distance(least, less);
      const double estimate = 2 * (change + last) + rounding(n);
      if (estimate <= tolerance && (last < 0.5 * one_before || last < rounding(n)))
        return {now, estimate, counted.count(), ""};
    }
    before = now;
  }
  return refused("its slow solutions do not settle in 1024 panels", counted.count());
}

Answer wei_norman_answer(bool exponential, int order, const Question& question, double tolerance) {
  const Column<double>& column = question.column;
  const WeiNorman<double> paper(order);
  const WeiNormanExp<double> improved(order);
  const TransportMethod<double>& method = exponential ? static_cast<const TransportMethod<double>&>(improved) : paper;
  const WeiNormanForm form = exponential ? improved.form() : paper.form();
  double samples = 0;
  Mat2<double> before = Mat2<double>::identity();
  double last_change = std::numeric_limits<double>::infinity();
  for (int n = 1; n <= 256; n *= 2) {
    const Mesh mesh = uniform_mesh(n, column.breaks);
    samples += static_cast<double>(mesh.size() - 1);  // one series a layer
    try {
      const WeiNormanReport report = wei_norman_report(column, question.ray, mesh, form);
      Mat2<double> now{std::numeric_limits<double>::quiet_NaN(), 0, 0, 0};
      try {
        now = response(method, question, mesh);
      } catch (const std::domain_error&) {  // layers too thick: the report says so too
      }
      const double change =
          finite(now) && finite(before) ? relative_distance(before, now) : std::numeric_limits<double>::infinity();
      before = now;
      // The report knows the dropped coupling and the ends of the series; the phase of the coupling, which is taken for
      // quadratic, shows under halving.
      const double estimate = 2 * (report.estimate + report.truncation + change) + rounding(n);
      if (n > 1 && report.valid && estimate <= tolerance && last_change >= change) return {now, estimate, samples, ""};
      last_change = change;
    } catch (const std::logic_error& error) {
      return refused(error.what(), samples);
    }
  }
  return refused("no number of layers up to 256 is within the tolerance by its own report", samples);
}

Answer ode_answer(bool scalar, const Question& question, double tolerance) {
  const CountingColumn<double> counted(question.column);
  const Question asked{counted, question.ray, question.host_index};
  const auto at = [&](double local) {
    const Mesh mesh = uniform_mesh(2, counted.breaks);
    return scalar ? response(OdeScalar<double>(local), asked, mesh) : response(OdeOperator(local), asked, mesh);
  };
  try {
    // Local errors add up along the phase: ask for a hundredth, and compare with a tenth of that.
    const Mat2<double> coarse = at(1e-2 * tolerance), fine = at(1e-3 * tolerance);
    if (!finite(coarse) || !finite(fine)) return refused("not finite", counted.count());
    const double change = relative_distance(coarse, fine);
    if (change > tolerance) return refused("tighter steps change it by more than the tolerance", counted.count());
    return {fine, 2 * change + 1e-13, counted.count(), ""};
  } catch (const std::logic_error& error) {
    return refused(error.what(), counted.count());
  }
}

}  // namespace birefit::study
