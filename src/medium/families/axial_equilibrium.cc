#include "medium/families/axial_equilibrium.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <deque>
#include <map>
#include <mutex>
#include <numbers>
#include <stdexcept>
#include <string>

#include "medium/families/axial_angle.h"

namespace birefit {
namespace {

/// Closed-form start (fits to the solutions of this file; within 0.15 rad everywhere): the boundary angle's tangent, less
/// what the field turns away from sphere and equator.
double ansatz(double field, double ring, double rho, double z) {
  const double e = std::abs(field);  // differences around no field ask for e < 0: the equations know its square
  const double r = std::hypot(rho, z), half = rho / (r + z);
  if (ring == 0) {
    const double a = e - 1.465 + 2.430 / (1 + std::pow(e / 1.957, 1.580));
    const double b = e * e / (e + 2.167 + 2.386 / (1 + std::pow(e / 5.080, 2.153)));
    return 2 * std::atan(half * (1 - (1 - std::exp(-a * (1 - r))) * (1 - std::exp(-b * z))));
  }
  const double q = (std::atan2(2 * ring * z, ring * ring - r * r) + std::atan2(2 * ring * z, 1 - ring * ring * r * r)) / std::numbers::pi;
  const double a = std::max(0.0, e - 0.79 * (1 + std::log(std::max(e, 1.0)))), b = 0.85 * e;
  const double zr = std::hypot(z, std::max(0.0, ring - rho));
  return 2 * std::atan(half * std::pow(std::max(q, 0.0), 1.25) * (1 - (1 - std::exp(-a * (1 - r))) * (1 - std::exp(-b * zr))));
}

/// Laplacian of theta_s, by second derivatives. Around the ring it grows like the inverse distance.
double laplacian_of_boundary_angle(double r, double polar, double ring) {
  if (ring == 0) return 1 / (r * r) / std::tan(polar);
  using First = Dual<double, 2>;
  using Second = Dual<First, 2>;
  Second rho(First(r * std::sin(polar))), z(First(r * std::cos(polar)));
  rho.value.d[0] = 1, rho.d[0] = First(1.0);
  z.value.d[1] = 1, z.d[1] = First(1.0);
  const Second t = axial_boundary_angle(rho, z, Second(First(ring)));
  return t.d[0].d[0] + t.d[1].d[1] + t.value.d[0] / rho.value.value;
}

/// Places of the nodes, weights of their quadrature and stiffness Int weight(x) slope_i slope_j along one coordinate.
struct Line {
  Eigen::VectorXd x, w;
  std::vector<Eigen::Triplet<double>> stiffness;
};
template <class Weight>
Line make_line(const AxialGrid& grid, const std::vector<double>& edges, const Weight& weight) {
  const LobattoRule& rule = lobatto_rule(grid.degree);
  const int n = grid.nodes(), p = grid.degree;
  Line line;
  line.x.resize(n);
  line.w = Eigen::VectorXd::Zero(n);
  for (int k = 0; k < grid.elements; ++k) {
    const double half = 0.5 * (edges[k + 1] - edges[k]), middle = 0.5 * (edges[k + 1] + edges[k]);
    for (int i = 0; i <= p; ++i) {
      line.x[k * p + i] = middle + half * rule.x[i];
      line.w[k * p + i] += std::abs(half) * rule.w[i];
    }
    for (int i = 0; i <= p; ++i)
      for (int j = 0; j <= p; ++j) {
        double sum = 0;
        for (int q = 0; q <= p; ++q) sum += rule.w[q] * weight(middle + half * rule.x[q]) * rule.derivative(q, i) * rule.derivative(q, j);
        line.stiffness.emplace_back(k * p + i, k * p + j, sum / std::abs(half));
      }
  }
  return line;
}

}  // namespace

const LobattoRule& lobatto_rule(int degree) {
  static std::map<int, LobattoRule> rules;
  static std::mutex guard;
  const std::lock_guard lock(guard);
  LobattoRule& rule = rules[degree];
  if (!rule.x.empty()) return rule;
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
      rule.derivative(i, j) = i != j ? legendre[i] / (legendre[j] * (rule.x[i] - rule.x[j])) : i == 0 ? -p * n / 4.0 : i == p ? p * n / 4.0 : 0.0;
  return rule;
}

namespace {

/// Weak form with Gauss-Lobatto quadrature in the nodes, change = 0 on every boundary:
///   (K_r w_v sin v + w_r K_v) change + w_r w_v {sin theta cos theta (1/sin v + e^2 r^2 sin v) - r^2 sin v laplacian theta_s} = 0.
struct Equations {
  int inner;
  Line r, polar;
  Eigen::SparseMatrix<double> stiffness;
  Eigen::VectorXd boundary, source, well, start;

  Equations(double e, double ring, const AxialGrid& grid) : inner(grid.nodes() - 2) {
    const bool has_ring = ring > 0;
    const int n = grid.nodes(), size = inner * inner;
    std::vector<double> r_edges, polar_edges;
    for (int k = 0; k <= grid.elements; ++k) {
      r_edges.push_back(axial_radius_edge(grid, k, e, ring, has_ring));
      polar_edges.push_back(axial_polar_edge(grid, k, e, ring, has_ring));
    }
    r = make_line(grid, r_edges, [](double x) { return x * x; });
    polar = make_line(grid, polar_edges, [](double x) { return std::sin(x); });
    const auto within = [&](int i) { return i > 0 && i < n - 1; };
    std::vector<Eigen::Triplet<double>> entries;
    for (const auto& t : r.stiffness)
      if (within(t.row()) && within(t.col()))
        for (int j = 1; j < n - 1; ++j) entries.emplace_back(at(t.row(), j), at(t.col(), j), t.value() * polar.w[j] * std::sin(polar.x[j]));
    for (const auto& t : polar.stiffness)
      if (within(t.row()) && within(t.col()))
        for (int i = 1; i < n - 1; ++i) entries.emplace_back(at(i, t.row()), at(i, t.col()), t.value() * r.w[i]);
    stiffness.resize(size, size);
    stiffness.setFromTriplets(entries.begin(), entries.end());
    boundary.resize(size), source.resize(size), well.resize(size), start.resize(size);
    for (int i = 1; i < n - 1; ++i)
      for (int j = 1; j < n - 1; ++j) {
        const double x = r.x[i], v = polar.x[j], s = std::sin(v), rho = x * s, z = x * std::cos(v), area = r.w[i] * polar.w[j];
        const int k = at(i, j);
        boundary[k] = axial_boundary_angle(rho, z, ring);
        source[k] = area * x * x * s * laplacian_of_boundary_angle(x, v, ring);
        well[k] = area * (1 / s + e * e * x * x * s);
        start[k] = ansatz(e, ring, rho, z) - boundary[k];
      }
  }
  int at(int i, int j) const { return (i - 1) * inner + j - 1; }
  Eigen::VectorXd residual(const Eigen::VectorXd& change) const {
    const Eigen::ArrayXd theta = (boundary + change).array();
    return stiffness * change + (well.array() * theta.sin() * theta.cos()).matrix() - source;
  }
  Eigen::SparseMatrix<double> jacobian(const Eigen::VectorXd& change) const {
    Eigen::SparseMatrix<double> j = stiffness;
    j.diagonal() += (well.array() * (2 * (boundary + change).array()).cos()).matrix();
    return j;
  }
};

}  // namespace

AxialEquilibrium axial_equilibrium(double e, double ring, const AxialGrid& grid, bool slopes) {
  const Equations equations(e, ring, grid);
  const int n = grid.nodes();
  AxialEquilibrium out{e, ring, grid, equations.r.x, equations.polar.x, {}, {}, {}};
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
  Eigen::VectorXd x = equations.start, residual = equations.residual(x);
  const auto factorize = [&](const Eigen::VectorXd& at) {
    const Eigen::SparseMatrix<double> jacobian = equations.jacobian(at);
    if (out.newton_steps == 0) solver.analyzePattern(jacobian);
    solver.factorize(jacobian);
    if (solver.info() != Eigen::Success) throw std::domain_error("equilibrium of the droplet: singular equations");
  };
  constexpr int kMostSteps = 60;
  constexpr double kSmallStep = 1e-9;  // rad
  constexpr double kNear = 0.03;       // rad; from here the last factors serve: each step is a few percent of the one before
  bool done = false, near = false;
  for (out.newton_steps = 0; out.newton_steps < kMostSteps && !done; ++out.newton_steps) {
    if (!near) factorize(x);
    const Eigen::VectorXd step = solver.solve(residual);
    const double size = step.cwiseAbs().maxCoeff();
    done = size < kSmallStep;
    near = near || size < kNear;
    double fraction = 1;
    Eigen::VectorXd next = x - step, after = equations.residual(next);
    while (!done && fraction > 1e-3 && after.norm() > (1 - 0.1 * fraction) * residual.norm()) {
      fraction /= 2;
      next = x - fraction * step;
      after = equations.residual(next);
    }
    x = next, residual = after;
  }
  if (!done)
    throw std::domain_error("equilibrium of the droplet: Newton's method did not converge at reduced field " + std::to_string(e) + ", ring radius " +
                            std::to_string(ring));
  // The nodes' values at another e or ring, by the implicit function theorem; the equations' own slope by differences,
  // 1e-9 of it: the nodes move with e and ring.
  const auto tangent = [&](double de, double dring) -> Eigen::VectorXd {
    const double h = de + dring;
    return solver.solve((Equations(e - de, ring - dring, grid).residual(x) - Equations(e + de, ring + dring, grid).residual(x)) / (2 * h));
  };
  const auto on_grid = [&](const Eigen::VectorXd& inside) {
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(n, n);
    for (int i = 1; i < n - 1; ++i)
      for (int j = 1; j < n - 1; ++j) m(i, j) = inside[equations.at(i, j)];
    return m;
  };
  out.change = on_grid(x);
  if (!slopes) return out;
  factorize(x);
  out.by_e = on_grid(tangent(1e-5 * (1 + e), 0));
  if (ring > 0) out.by_ring = on_grid(tangent(0, 1e-5 * std::min(ring, 1 - ring)));
  return out;
}

std::shared_ptr<const AxialEquilibrium> known_axial_equilibrium(double e, double ring, bool slopes) {
  static std::deque<std::shared_ptr<const AxialEquilibrium>> known;
  static std::mutex guard;
  {
    const std::lock_guard lock(guard);
    for (const auto& one : known)
      if (one->e == e && one->ring == ring && (!slopes || one->by_e.size() > 0)) return one;
  }
  auto fresh = std::make_shared<const AxialEquilibrium>(axial_equilibrium(e, ring, axial_production_grid(ring), slopes));
  const std::lock_guard lock(guard);
  known.push_front(fresh);
  if (known.size() > 64) known.pop_back();
  return fresh;
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

/// 4 pi times half the squared gradient of theta_s over the quarter disc; of a ring less pi^2/2 ring ln(1 / r_c), where all but
/// that logarithm converges as the tube around the ring that is left out, r_c thick, shrinks. Along rays from the ring.
double energy_of_boundary_angle(double ring) {
  if (ring == 0) return 2 * std::numbers::pi;
  const auto panels = [](const auto& f, double from, double to, int n) {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += boost::math::quadrature::gauss<double, 20>::integrate(f, from + (to - from) * i / n, from + (to - from) * (i + 1) / n);
    return sum;
  };
  const auto along = [&](double angle) {
    double c, s;
    sin_cos(angle, s, c);
    const double to_sphere = std::sqrt(1 - ring * ring * s * s) - ring * c, end = c < 0 ? std::min(to_sphere, -ring / c) : to_sphere;
    const double core = 0.5 * std::numbers::pi * ring;
    const auto rest = [&](double d) {
      Dual<double, 2> rho(ring + d * c), z(d * s);
      rho.d[0] = z.d[1] = 1;
      const Dual<double, 2> t = axial_boundary_angle(rho, z, Dual<double, 2>(ring));
      return 2 * std::numbers::pi * d * (ring + d * c) * (t.d[0] * t.d[0] + t.d[1] * t.d[1]) - core / d;
    };
    // The ring's image in the sphere is about as far as the sphere.
    double sum = core * std::log(end);
    for (double from = 0, to = std::min(end, 1 - ring); from < end; from = to, to = std::min(end, 2 * to)) sum += panels(rest, from, to, 1);
    return sum;
  };
  const double pole = std::numbers::pi - std::atan(1 / ring);
  return panels(along, 0, pole, 12) + panels(along, pole, std::numbers::pi, 4);
}

}  // namespace

double AxialEquilibrium::energy() const {
  // theta = theta_s + change: the gradients' product is, by parts, -change laplacian theta_s, since change vanishes on every boundary.
  const Equations equations(e, ring, grid);
  const int n = grid.nodes();
  Eigen::VectorXd inside(equations.inner * equations.inner);
  double sum = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      if (i > 0 && j > 0 && i < n - 1 && j < n - 1) inside[equations.at(i, j)] = change(i, j);
      const double x = r[i], v = polar_rad[j], s = std::sin(v);
      const double boundary = x > 0 ? axial_boundary_angle(x * s, std::max(x * std::cos(v), 0.0), ring) : ring > 0 ? 0.0 : v;
      const double st = std::sin(boundary + change(i, j)), over = s > 1e-12 ? st * st / s : 0.0;
      sum += equations.r.w[i] * equations.polar.w[j] * 0.5 * (over + e * e * x * x * s * st * st);
    }
  sum += 0.5 * inside.dot(equations.stiffness * inside) - equations.source.dot(inside);
  return 4 * std::numbers::pi * sum + energy_of_boundary_angle(ring);  // both halves
}

RingBalance ring_balance(double e, double ring) {
  static std::mutex guard;
  static double known_e = -1, known_ring = -1;
  static RingBalance known{};
  {
    const std::lock_guard lock(guard);
    if (known_e == e && known_ring == ring) return known;
  }
  const double step = 0.05 * (1 - ring), below = std::max(0.2, ring - step), above = std::min(0.995, ring + step), half = 0.5 * (above - below);
  const auto energy = [&](double at) { return known_axial_equilibrium(e, at, false)->energy(); };
  const double low = energy(below), here = energy(below + half), high = energy(above);
  const RingBalance fresh{-(high - low) / (std::numbers::pi * std::numbers::pi * half), high - 2 * here + low > 0};
  const std::lock_guard lock(guard);
  known_e = e, known_ring = ring, known = fresh;
  return fresh;
}

}  // namespace birefit
