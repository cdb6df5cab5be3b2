#include "medium/families/axial_equilibrium.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "birefit/memo.h"
#include "medium/families/axial_angle.h"

namespace birefit {
namespace {

/// Closed-form start (fits to the solutions of this file; within 0.15 rad everywhere): the boundary angle's tangent,
/// less what the field turns away from sphere and equator.
double ansatz(double field, double ring, double rho, double z) {
  const double e = std::abs(field);  // differences around no field ask for e < 0: the equations know its square
  const double r = std::hypot(rho, z), half = rho / (r + z);
  if (ring == 0) {
    const double a = e - 1.465 + 2.430 / (1 + std::pow(e / 1.957, 1.580));
    const double b = e * e / (e + 2.167 + 2.386 / (1 + std::pow(e / 5.080, 2.153)));
    return 2 * std::atan(half * (1 - (1 - std::exp(-a * (1 - r))) * (1 - std::exp(-b * z))));
  }
  const double q = (std::atan2(2 * ring * z, ring * ring - r * r) + std::atan2(2 * ring * z, 1 - ring * ring * r * r)) /
                   std::numbers::pi;
  const double a = std::max(0.0, e - 0.79 * (1 + std::log(std::max(e, 1.0)))), b = 0.85 * e;
  const double zr = std::hypot(z, std::max(0.0, ring - rho));
  return 2 * std::atan(half * std::pow(std::max(q, 0.0), 1.25) *
                       (1 - (1 - std::exp(-a * (1 - r))) * (1 - std::exp(-b * zr))));
}

/// theta_s (axial_boundary_angle()) and its Laplacian (around the ring it grows like the inverse distance): with v the
/// polar angle and Q = pi q / 2, both harmonic in the plane (rho, z), theta_s = 2 atan exp u, u = ln tan(v/2) + ln
/// tan(Q/2), and
///   laplacian theta = sin theta {laplacian_2D u + cos theta |grad u|^2 + u_rho / rho},   laplacian_2D ln tan(Q/2) =
///   -cos Q |grad Q|^2 / sin^2 Q.
struct BoundaryAngle {
  double value, laplacian;
};
// s, c: sine and cosine of the polar angle
BoundaryAngle boundary_angle(double r, double polar, double s, double c, double ring) {
  if (ring == 0) return {polar, c / (s * r * r)};
  const double rho = r * s, z = r * c, ring2 = ring * ring, b = 2 * ring * z;
  // a + i b: the two factors whose arguments make 2 Q.
  const double a[2] = {ring2 - r * r, 1 - ring2 * r * r}, fall[2] = {2.0, 2 * ring2};
  double q = 0, q_rho = 0, q_z = 0;
  for (int i = 0; i < 2; ++i) {
    const double over = 0.5 / (a[i] * a[i] + b * b);
    q += 0.5 * std::atan2(b, a[i]);
    q_rho += over * b * fall[i] * rho;
    q_z += over * (a[i] * 2 * ring + b * fall[i] * z);
  }
  double sq, cq;
  sin_cos(q, sq, cq);
  const double w = s * sq / ((1 + c) * (1 + cq)), st = 2 * w / (1 + w * w), ct = (1 - w) * (1 + w) / (1 + w * w);
  const double u_rho = c / (r * s) + q_rho / sq, u_z = -1 / r + q_z / sq;
  const double u2 = -c / (r * r * s * s) - cq * (q_rho * q_rho + q_z * q_z) / (sq * sq);
  return {2 * std::atan(w), st * (u2 + ct * (u_rho * u_rho + u_z * u_z) + u_rho / rho)};
}

/// Places of the nodes, weights of their quadrature and stiffness Int weight(x) slope_i slope_j along one coordinate.
struct Line {
  Eigen::VectorXd x, w;
  Eigen::MatrixXd stiffness;
};
template <class Weight>
Line make_line(const AxialGrid& grid, const std::vector<double>& edges, const Weight& weight) {
  const LobattoRule& rule = lobatto_rule(grid.degree);
  const int n = grid.nodes(), p = grid.degree;
  Line line;
  line.x.resize(n);
  line.w = Eigen::VectorXd::Zero(n);
  line.stiffness = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < grid.elements; ++k) {
    const double half = 0.5 * (edges[k + 1] - edges[k]), middle = 0.5 * (edges[k + 1] + edges[k]);
    for (int i = 0; i <= p; ++i) {
      line.x[k * p + i] = middle + half * rule.x[i];
      line.w[k * p + i] += std::abs(half) * rule.w[i];
    }
    for (int i = 0; i <= p; ++i)
      for (int j = 0; j <= p; ++j) {
        double sum = 0;
        for (int q = 0; q <= p; ++q)
          sum += rule.w[q] * weight(middle + half * rule.x[q]) * rule.derivative(q, i) * rule.derivative(q, j);
        line.stiffness(k * p + i, k * p + j) += sum / std::abs(half);
      }
  }
  return line;
}

LobattoRule make_lobatto_rule(int degree) {
  LobattoRule rule;
  const int p = degree, n = p + 1;
  rule.x.resize(n), rule.w.resize(n);
  std::vector<double> legendre(n);
  for (int i = 0; i < n; ++i) {
    double x = -std::cos(std::numbers::pi * i / p), previous = 0, value = 1;
    for (int step = 0; step < 100; ++step) {  // Newton on (1 - x^2) P_p'
      previous = 1, value = x;
      for (int k = 2; k <= p; ++k) {
        const double next = ((2 * k - 1) * x * value - (k - 1) * previous) / k;
        previous = value, value = next;
      }
      const double change = (x * value - previous) / (n * value);
      x -= change;
      if (std::abs(change) < 1e-16) break;
    }
    rule.x[i] = x, legendre[i] = value;
    rule.w[i] = 2 / (p * n * value * value);
  }
  rule.derivative.resize(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      rule.derivative(i, j) = i != j   ? legendre[i] / (legendre[j] * (rule.x[i] - rule.x[j]))
                              : i == 0 ? -p * n / 4.0
                              : i == p ? p * n / 4.0
                                       : 0.0;
  return rule;
}

}  // namespace

const LobattoRule& lobatto_rule(int degree) {
  constexpr int kMost = 20;
  static const std::vector<LobattoRule> rules = [] {
    std::vector<LobattoRule> all(1);  // there is none of degree 0
    for (int p = 1; p <= kMost; ++p) all.push_back(make_lobatto_rule(p));
    return all;
  }();
  return rules.at(static_cast<std::size_t>(degree));
}

namespace {

/// Values in the nodes inside, (r, polar angle).
using Field = Eigen::Array<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Factors = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;

/// Weak form with Gauss-Lobatto quadrature in the nodes, change = 0 on every boundary:
///   (K_r w_v sin v + w_r K_v) change + w_r w_v {sin theta cos theta (1/sin v + e^2 r^2 sin v) - r^2 sin v laplacian
///   theta_s} = 0.
struct Equations {
  int inner, degree;
  Line r, polar;
  Eigen::MatrixXd r_stiffness, polar_stiffness;  ///< of the nodes inside
  Eigen::ArrayXd r_weight, polar_weight;         ///< w_r, w_v sin v of the nodes inside
  Field boundary, source, well;

  Equations(double e, double ring, const AxialGrid& grid) : inner(grid.nodes() - 2), degree(grid.degree) {
    const bool has_ring = ring > 0;
    std::vector<double> r_edges, polar_edges;
    for (int k = 0; k <= grid.elements; ++k) {
      r_edges.push_back(axial_radius_edge(grid, k, e, ring, has_ring));
      polar_edges.push_back(axial_polar_edge(grid, k, e, ring, has_ring));
    }
    r = make_line(grid, r_edges, [](double x) { return x * x; });
    polar = make_line(grid, polar_edges, [](double x) { return std::sin(x); });
    r_stiffness = r.stiffness.block(1, 1, inner, inner);
    polar_stiffness = polar.stiffness.block(1, 1, inner, inner);
    r_weight = r.w.segment(1, inner);
    polar_weight = polar.w.segment(1, inner).array() * polar.x.segment(1, inner).array().sin();
    boundary.resize(inner, inner), source.resize(inner, inner), well.resize(inner, inner);
    for (int j = 0; j < inner; ++j) {
      double s, c;
      sin_cos(polar.x[j + 1], s, c);
      for (int i = 0; i < inner; ++i) {
        const double x = r.x[i + 1], area = r.w[i + 1] * polar.w[j + 1];
        const BoundaryAngle angle = boundary_angle(x, polar.x[j + 1], s, c, ring);
        boundary(i, j) = angle.value;
        source(i, j) = area * x * x * s * angle.laplacian;
        well(i, j) = area * (1 / s + e * e * x * x * s);
      }
    }
  }
  Field start(double e, double ring) const {
    Field change(inner, inner);
    for (int i = 0; i < inner; ++i)
      for (int j = 0; j < inner; ++j) {
        const double x = r.x[i + 1], v = polar.x[j + 1];
        change(i, j) = ansatz(e, ring, x * std::sin(v), x * std::cos(v)) - boundary(i, j);
      }
    return change;
  }
  Field stiffness(const Field& change) const {
    return (r_stiffness * change.matrix()).array().rowwise() * polar_weight.transpose() +
           (change.matrix() * polar_stiffness).array().colwise() * r_weight;
  }
  Field residual(const Field& change) const {
    const Field theta = boundary + change;
    return stiffness(change) + well * theta.sin() * theta.cos() - source;
  }
  /// of the well: what the Jacobian has beside the stiffness
  Field curvature(const Field& change) const { return well * (2 * (boundary + change)).cos(); }
  Eigen::SparseMatrix<double> jacobian(const Field& change) const {
    const Field diagonal = curvature(change);
    // Nodes share an element: all between its first and its last, of those inside.
    const auto first = [&](int k) {
      return std::max(0, (k + 1) % degree == 0 ? k - degree : (k + 1) / degree * degree - 1);
    };
    const auto last = [&](int k) { return std::min(inner - 1, ((k + 1) / degree + 1) * degree - 1); };
    Eigen::SparseMatrix<double> j(inner * inner, inner * inner);
    j.reserve(inner * inner * 4 * degree);
    for (int column = 0; column < inner * inner; ++column) {
      const int c = column / inner, d = column % inner;
      j.startVec(column);
      for (int row = first(c); row <= last(c); ++row) {
        if (row != c) {
          j.insertBack(row * inner + d, column) = r_stiffness(row, c) * polar_weight[d];
          continue;
        }
        for (int k = first(d); k <= last(d); ++k)
          j.insertBack(row * inner + k, column) = r_weight[c] * polar_stiffness(k, d) +
                                                  (k == d ? r_stiffness(c, c) * polar_weight[d] + diagonal(c, d) : 0.0);
      }
    }
    j.finalize();
    return j;
  }
};

Field solve(const Factors& factors, const Field& right) {
  Field x(right.rows(), right.cols());
  Eigen::VectorXd::Map(x.data(), x.size()) = factors.solve(Eigen::VectorXd::Map(right.data(), right.size()));
  return x;
}
void factorize(Factors& factors, const Equations& equations, const Field& change) {
  const Eigen::SparseMatrix<double> jacobian = equations.jacobian(change);
  if (factors.rows() == 0) factors.analyzePattern(jacobian);
  factors.factorize(jacobian);
  if (factors.info() != Eigen::Success) throw std::domain_error("equilibrium of the droplet: singular equations");
}

/// Slopes of the nodes' values by e and ring, by the implicit function theorem; the equations' own slope by
/// differences, 1e-9 of it: the nodes move with e and ring. `solve`: by the Jacobian.
struct Slopes {
  Field by_e, by_ring;  ///< the latter empty of a hedgehog
};
template <class Solve>
Slopes slopes_of(double e, double ring, const AxialGrid& grid, const Field& change, const Solve& solve) {
  const auto slope = [&](double de, double dring) -> Field {
    return solve(Field((Equations(e - de, ring - dring, grid).residual(change) -
                        Equations(e + de, ring + dring, grid).residual(change)) /
                       (2 * (de + dring))));
  };
  Slopes s{slope(1e-5 * (1 + e), 0), {}};
  if (ring > 0) s.by_ring = slope(0, 1e-5 * std::min(ring, 1 - ring));
  return s;
}

/// Newton's method; `factors` are left near those of the solution. Returns the steps.
int solve_by_newton(const Equations& equations, double e, double ring, Factors& factors, Field& x) {
  constexpr int kMostSteps = 60;
  constexpr double kSmallStep = 1e-9;  // rad
  // rad; from here the last factors serve: each step is a few percent of the one before
  constexpr double kNear = 0.03;
  bool near = false;
  Field residual = equations.residual(x);
  for (int steps = 1; steps <= kMostSteps; ++steps) {
    if (!near) factorize(factors, equations, x);
    const Field step = solve(factors, residual);
    const double size = step.abs().maxCoeff();
    const bool done = size < kSmallStep;
    near = near || size < kNear;
    double fraction = 1;
    Field next = x - step, after = equations.residual(next);
    while (!done && fraction > 1e-3 && after.matrix().norm() > (1 - 0.1 * fraction) * residual.matrix().norm()) {
      fraction /= 2;
      next = x - fraction * step;
      after = equations.residual(next);
    }
    x = next, residual = after;
    if (done) return steps;
  }
  throw std::domain_error("equilibrium of the droplet: Newton's method did not converge at reduced field " +
                          std::to_string(e) + ", ring radius " + std::to_string(ring));
}

AxialEquilibrium equilibrium_of(double e, double ring, const AxialGrid& grid, const Equations& equations,
                                const Field& change, const Slopes& slopes, int steps) {
  const auto on_grid = [&](const Field& inside) {
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(grid.nodes(), grid.nodes());
    m.block(1, 1, inside.rows(), inside.cols()) = inside.matrix();
    return m;
  };
  const auto if_any = [&](const Field& f) { return f.size() > 0 ? on_grid(f) : Eigen::MatrixXd(); };
  return {
      e,    ring, grid, equations.r.x, equations.polar.x, on_grid(change), if_any(slopes.by_e), if_any(slopes.by_ring),
      steps};
}

}  // namespace

AxialEquilibrium axial_equilibrium(double e, double ring, const AxialGrid& grid, bool slopes) {
  const Equations equations(e, ring, grid);
  Factors factors;
  Field x = equations.start(e, ring);
  const int steps = solve_by_newton(equations, e, ring, factors, x);
  if (!slopes) return equilibrium_of(e, ring, grid, equations, x, {}, steps);
  factorize(factors, equations, x);
  return equilibrium_of(e, ring, grid, equations, x,
                        slopes_of(e, ring, grid, x, [&](const Field& right) { return solve(factors, right); }), steps);
}

namespace {

/// An equilibrium on the production grid that serves its neighbours: what they start from, and the factors of their
/// steps.
struct Rung {
  double e, ring;
  Field change;
  Slopes slopes;
  Factors factors;
};
using EquilibriumKey = std::array<double, 3>;  // e, ring, whether with slopes
struct Ladder : Recent<EquilibriumKey, Rung> {
  // reduced fields up to 100 with a hedgehog: a scan that goes through more than are kept would find none. 20 MB
  Ladder() : Recent(48) {}
};
struct KnownEquilibria : Recent<EquilibriumKey, AxialEquilibrium> {
  KnownEquilibria() : Recent(1024) {}  // what a scan of bounds several orders wide asks for, place after place. 10 MB
};
struct KnownBalances : Recent<EquilibriumKey, RingBalance> {
  KnownBalances() : Recent(16) {}  // several plans of the same place, one after the other
};

/// The rung nearest to (e, ring), of a ladder that is fixed, so that what is found from it does not depend on what was
/// asked before. Rungs are so close that a step with the factors of one leaves a tenth of the error.
std::shared_ptr<const Rung> rung_near(double e, double ring, Memo* memo) {
  constexpr double kStep = 0.08;
  const double rung_e = 3 * std::expm1(kStep * std::round(std::log1p(e / 3) / kStep));
  const double rung_ring = ring > 0 ? 1 - std::exp(kStep * std::round(std::log(1 - ring) / kStep)) : 0.0;
  return remembered<Ladder>(memo, EquilibriumKey{rung_e, rung_ring, 1}, [&] {
    const AxialGrid grid = axial_production_grid(ring);
    const Equations equations(rung_e, rung_ring, grid);
    auto fresh = std::make_shared<Rung>();
    fresh->e = rung_e, fresh->ring = rung_ring;
    fresh->change = equations.start(rung_e, rung_ring);
    solve_by_newton(equations, rung_e, rung_ring, fresh->factors, fresh->change);
    factorize(fresh->factors, equations, fresh->change);
    fresh->slopes = slopes_of(rung_e, rung_ring, grid, fresh->change,
                              [&](const Field& right) { return solve(fresh->factors, right); });
    return fresh;
  });
}

/// axial_equilibrium() on the production grid, from the nearest rung: no factors of its own, a quarter of the time.
AxialEquilibrium from_rung(double e, double ring, bool slopes, Memo* memo) {
  constexpr int kMostSteps = 20;  // 5 are usual: each leaves 2 to 10 percent
  constexpr double kSmallStep = 1e-9;
  const AxialGrid grid = axial_production_grid(ring);
  const auto rung = rung_near(e, ring, memo);
  const Equations equations(e, ring, grid);
  // `x` such that residual(x) vanishes, to kSmallStep of its size or of 1.
  const auto refine = [&](Field& x, const auto& residual) {
    for (int steps = 1; steps <= kMostSteps; ++steps) {
      const Field step = solve(rung->factors, residual(x));
      x -= step;
      if (step.abs().maxCoeff() < kSmallStep * std::max(1.0, x.abs().maxCoeff())) return steps;
    }
    return 0;
  };
  Field x = rung->change + (e - rung->e) * rung->slopes.by_e;
  if (ring > 0) x += (ring - rung->ring) * rung->slopes.by_ring;
  const int steps = refine(x, [&](const Field& at) { return equations.residual(at); });
  bool converged = steps > 0;
  Slopes found;
  if (converged && slopes) {
    const Field curvature = equations.curvature(x);
    found = slopes_of(e, ring, grid, x, [&](const Field& right) {
      Field slope = solve(rung->factors, right);
      converged = converged && refine(slope, [&](const Field& at) -> Field {
                                 return equations.stiffness(at) + curvature * at - right;
                               }) > 0;
      return slope;
    });
  }
  return converged ? equilibrium_of(e, ring, grid, equations, x, found, steps)
                   : axial_equilibrium(e, ring, grid, slopes);
}

}  // namespace

std::shared_ptr<const AxialEquilibrium> known_axial_equilibrium(double e, double ring, bool slopes, Memo* memo) {
  if (!slopes && memo)
    if (auto known = memo->of<KnownEquilibria>().find({e, ring, 1})) return known;
  return remembered<KnownEquilibria>(memo, EquilibriumKey{e, ring, slopes ? 1.0 : 0.0}, [&] {
    return std::make_shared<AxialEquilibrium>(from_rung(e, ring, slopes, memo));
  });
}

double AxialEquilibrium::theta(double rho, double z) const {
  const LobattoRule& rule = lobatto_rule(grid.degree);
  const int p = grid.degree;
  const auto weights = [&](const Eigen::VectorXd& nodes, double value, std::vector<double>& basis) {
    int k = 0;
    const bool growing = nodes[nodes.size() - 1] > nodes[0];
    while (k + 1 < grid.elements && (growing ? value > nodes[(k + 1) * p] : value < nodes[(k + 1) * p])) ++k;
    const double a = nodes[k * p], b = nodes[(k + 1) * p], x = 2 * (value - a) / (b - a) - 1;
    for (int i = 0; i <= p; ++i) {
      basis[i] = 1;
      for (int m = 0; m <= p; ++m)
        if (m != i) basis[i] *= (x - rule.x[m]) / (rule.x[i] - rule.x[m]);
    }
    return k * p;
  };
  std::vector<double> br(p + 1), bv(p + 1);
  const int i0 = weights(r, std::hypot(rho, z), br), j0 = weights(polar_rad, std::atan2(rho, z), bv);
  double sum = axial_boundary_angle(rho, z, ring);
  for (int i = 0; i <= p; ++i)
    for (int j = 0; j <= p; ++j) sum += br[i] * bv[j] * change(i0 + i, j0 + j);
  return sum;
}

namespace {

/// 4 pi times half the squared gradient of theta_s over the quarter disc; of a ring less pi^2/2 ring ln(1 / r_c), where
/// all but that logarithm converges as the tube around the ring that is left out, r_c thick, shrinks. Along rays from
/// the ring.
double energy_of_boundary_angle(double ring) {
  if (ring == 0) return 2 * std::numbers::pi;
  const auto panels = [](const auto& f, double from, double to, int n) {
    double sum = 0;
    for (int i = 0; i < n; ++i)
      sum += boost::math::quadrature::gauss<double, 20>::integrate(f, from + (to - from) * i / n,
                                                                   from + (to - from) * (i + 1) / n);
    return sum;
  };
  const auto along = [&](double angle) {
    double c, s;
    sin_cos(angle, s, c);
    const double to_sphere = std::sqrt(1 - ring * ring * s * s) - ring * c,
                 end = c < 0 ? std::min(to_sphere, -ring / c) : to_sphere;
    const double core = 0.5 * std::numbers::pi * ring;
    const auto rest = [&](double d) {
      Dual<double, 2> rho(ring + d * c), z(d * s);
      rho.d[0] = z.d[1] = 1;
      const Dual<double, 2> t = axial_boundary_angle(rho, z, Dual<double, 2>(ring));
      return 2 * std::numbers::pi * d * (ring + d * c) * (t.d[0] * t.d[0] + t.d[1] * t.d[1]) - core / d;
    };
    // The ring's image in the sphere is about as far as the sphere.
    double sum = core * std::log(end);
    for (double from = 0, to = std::min(end, 1 - ring); from < end; from = to, to = std::min(end, 2 * to))
      sum += panels(rest, from, to, 1);
    return sum;
  };
  const double pole = std::numbers::pi - std::atan(1 / ring);
  return panels(along, 0, pole, 12) + panels(along, pole, std::numbers::pi, 4);
}

}  // namespace

double AxialEquilibrium::energy() const {
  // theta = theta_s + change: the gradients' product is, by parts, -change laplacian theta_s, since change vanishes on
  // every boundary.
  const Equations equations(e, ring, grid);
  const int n = grid.nodes();
  const Field inside = change.block(1, 1, equations.inner, equations.inner).array();
  double sum = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double x = r[i], v = polar_rad[j], s = std::sin(v);
      const double boundary = x > 0      ? axial_boundary_angle(x * s, std::max(x * std::cos(v), 0.0), ring)
                              : ring > 0 ? 0.0
                                         : v;
      const double st = std::sin(boundary + change(i, j)), over = s > 1e-12 ? st * st / s : 0.0;
      sum += equations.r.w[i] * equations.polar.w[j] * 0.5 * (over + e * e * x * x * s * st * st);
    }
  sum += (0.5 * inside * equations.stiffness(inside) - equations.source * inside).sum();
  return 4 * std::numbers::pi * sum + energy_of_boundary_angle(ring);  // both halves
}

RingBalance ring_balance(double e, double ring, Memo* memo) {
  const double step = 0.05 * (1 - ring), below = std::max(0.2, ring - step), above = std::min(0.995, ring + step),
               half = 0.5 * (above - below);
  return *remembered<KnownBalances>(memo, EquilibriumKey{e, ring, 0}, [&] {
    const auto energy = [&](double at) { return known_axial_equilibrium(e, at, false, memo)->energy(); };
    const double low = energy(below), here = energy(below + half), high = energy(above);
    return std::make_shared<RingBalance>(
        RingBalance{-(high - low) / (std::numbers::pi * std::numbers::pi * half), high - 2 * here + low > 0});
  });
}

}  // namespace birefit
