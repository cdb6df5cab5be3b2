#include "medium/families/equilibrium.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "birefit/error.h"
#include "birefit/memo.h"

namespace birefit {
namespace {

constexpr double kPi = std::numbers::pi;

// ---- the start -----------------------------------------------------------------------------------------------------

/// Complete elliptic integral K by the arithmetic-geometric mean, from 1 - m.
double complete_k(double one_minus_m) {
  double a = 1, b = std::sqrt(one_minus_m);
  for (int i = 0; i < 40 && std::abs(a - b) > 1e-15 * a; ++i) {
    const double mean = 0.5 * (a + b);
    b = std::sqrt(a * b);
    a = mean;
  }
  return kPi / (a + b);
}

/// am(x | m) by descending Landen steps (Abramowitz & Stegun 16.4).
double amplitude(double x, double one_minus_m) {
  double a[24], c[24];
  a[0] = 1;
  c[0] = std::sqrt(1 - one_minus_m);
  double b = std::sqrt(one_minus_m);
  int n = 0;
  while (n < 23 && std::abs(c[n]) > 1e-15 * a[n]) {
    a[n + 1] = 0.5 * (a[n] + b);
    c[n + 1] = 0.5 * (a[n] - b);
    b = std::sqrt(a[n] * b);
    ++n;
  }
  double phi = std::ldexp(a[n] * x, n);
  for (; n > 0; --n) phi = 0.5 * (phi + std::asin(std::clamp(c[n] / a[n] * std::sin(phi), -1.0, 1.0)));
  return phi;
}

/// Angle from the anchored direction at depth zeta, at V/Vth = v, of one constant, a uniform field and a pretilt: a
/// start, no more. v > 1: sin t = sqrt(m) sn(2 K zeta), K(m) = pi v / 2; below, the cubic amplitude equation of the
/// pretilted cell.
class EllipticStart {
 public:
  EllipticStart(double v, double pretilt) : pretilt_(pretilt) {
    if (v > 1) {
      double low = -600, high = 0;  // ln(1 - m)
      for (int i = 0; i < 80; ++i) {
        const double middle = 0.5 * (low + high);
        (complete_k(std::exp(middle)) > kPi / 2 * v ? low : high) = middle;
      }
      one_minus_m_ = std::exp(0.5 * (low + high));
      quarter_ = complete_k(one_minus_m_);
    } else {
      double low = 0, high = kPi / 2;
      for (int i = 0; i < 60; ++i) {
        const double t = 0.5 * (low + high);
        (0.25 * t * t * t + (1 - v) * t < 2 / kPi * pretilt ? low : high) = t;
      }
      swing_ = low;
    }
  }
  double at(double zeta) const {
    const double swing =
        quarter_ > 0
            ? std::asin(std::clamp(std::sqrt(1 - one_minus_m_) * std::sin(amplitude(2 * quarter_ * zeta, one_minus_m_)),
                                   0.0, 1.0))
            : swing_ * std::sin(kPi * zeta);
    return pretilt_ + (1 - pretilt_ * 2 / kPi) * swing;
  }

 private:
  double pretilt_, one_minus_m_ = 1, quarter_ = 0, swing_ = 0;
};

// ---- the discrete energy -------------------------------------------------------------------------------------------

/// Density at one point without the electric part: its derivatives by t, t', f' and those of q = sin^2 t / (1 + gamma
/// sin^2 t).
template <class R>
struct Density {
  R e, e_t, e_tp, e_fp;
  R q, q_t;
  // second derivatives
  R tt, ttp, tptp, tfp, fpfp, q_tt;
};

template <bool kTwisted, bool kSecond, class R>
Density<R> density(const CellForces<R>& p, const R& t, const R& tp, const R& fp) {
  R s, c;
  sin_cos(t, s, c);
  const R x = s * s, x1 = 2.0 * s * c, x2 = 2.0 * (c * c - x);
  const R bend = p.k33 - 1.0, a = 1.0 + bend * x;
  Density<R> r;
  r.e = 0.5 * a * tp * tp;
  r.e_t = 0.5 * bend * x1 * tp * tp;
  r.e_tp = a * tp;
  const R d = inverse(1.0 + p.gamma * x), d2 = d * d;
  r.q = x * d;
  r.q_t = x1 * d2;
  if constexpr (kSecond) {
    r.tt = 0.5 * bend * x2 * tp * tp;
    r.ttp = bend * x1 * tp;
    r.tptp = a;
    r.q_tt = x2 * d2 - 2.0 * p.gamma * x1 * x1 * d2 * d;
  }
  if constexpr (kTwisted) {
    const R difference = p.k33 - p.k22, inner = p.k22 + difference * x;
    const R b = c * c * inner, b_x = c * c * difference - inner, pull = p.k22 * p.chirality;
    r.e = r.e + (0.5 * b * fp - pull * c * c) * fp;
    r.e_t = r.e_t + (0.5 * b_x * fp + pull) * x1 * fp;
    r.e_fp = b * fp - pull * c * c;
    if constexpr (kSecond) {
      r.tt = r.tt + (-difference * x1 * x1 * fp + (0.5 * b_x * fp + pull) * x2) * fp;
      r.tfp = (b_x * fp + pull) * x1;
      r.fpfp = b;
    }
  }
  return r;
}

/// Symmetric positive definite band, one row after another: entry (i, j), i - width <= j <= i.
class SymmetricBand {
 public:
  SymmetricBand(int size, int width)
      : size_(size), width_(width), a_(static_cast<std::size_t>(size) * static_cast<std::size_t>(width + 1), 0.0) {}
  double& operator()(int i, int j) {
    return a_[static_cast<std::size_t>(i) * static_cast<std::size_t>(width_ + 1) +
              static_cast<std::size_t>(j - i + width_)];
  }
  double operator()(int i, int j) const { return const_cast<SymmetricBand&>(*this)(i, j); }
  /// Cholesky's factor in place; false when not positive definite.
  bool factor() {
    for (int i = 0; i < size_; ++i) {
      const int from = std::max(0, i - width_);
      for (int j = from; j <= i; ++j) {
        const int start = std::max(from, j - width_);
        const double *ri = &(*this)(i, start), *rj = &(*this)(j, start);
        double sum = (*this)(i, j);
        for (int k = 0; k < j - start; ++k) sum -= ri[k] * rj[k];
        if (j < i) {
          (*this)(i, j) = sum / (*this)(j, j);
        } else {
          if (!(sum > 0)) return false;
          (*this)(i, i) = std::sqrt(sum);
        }
      }
    }
    return true;
  }
  void solve(std::vector<double>& b) const {
    for (int i = 0; i < size_; ++i) {
      double sum = b[static_cast<std::size_t>(i)];
      for (int j = std::max(0, i - width_); j < i; ++j) sum -= (*this)(i, j) * b[static_cast<std::size_t>(j)];
      b[static_cast<std::size_t>(i)] = sum / (*this)(i, i);
    }
    for (int i = size_ - 1; i >= 0; --i) {
      const double x = b[static_cast<std::size_t>(i)] / (*this)(i, i);
      b[static_cast<std::size_t>(i)] = x;
      for (int j = std::max(0, i - width_); j < i; ++j) b[static_cast<std::size_t>(j)] -= (*this)(i, j) * x;
    }
  }
  /// Takes an unknown out: a row and column of the identity.
  void fix(int i) {
    for (int j = std::max(0, i - width_); j < i; ++j) (*this)(i, j) = 0;
    for (int j = i + 1; j < std::min(size_, i + width_ + 1); ++j) (*this)(j, i) = 0;
    (*this)(i, i) = 1;
  }
  void add_to_diagonal(double x) {
    for (int i = 0; i < size_; ++i) (*this)(i, i) += x;
  }

 private:
  int size_, width_;
  std::vector<double> a_;
};

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

/// Energy, gradient by the free nodes' unknowns (tilt, or tilt and azimuth in turn) and pull = dQ/d(unknowns).
template <class R>
struct Slopes {
  R energy = R(0.0), q = R(0.0);
  std::vector<R> gradient, pull;
};

/// The part of one element in the Hessian by the free nodes' unknowns.
template <bool kTwisted>
void add_element(const DirectorMesh& mesh, int e, const Density<double>* points, double electric,
                 SymmetricBand& hessian) {
  constexpr int kMost = 21, kEach = kTwisted ? 2 : 1;  // nodes of an element
  // By (t'_i, t'_j), (f'_i, f'_j), (t_k, t'_j), (t_k, f'_j).
  std::array<double, kMost * kMost> tptp{}, fpfp{}, ttp, tfp;
  const int n = mesh.degree() + 1, inner = mesh.free_nodes(), base = e * mesh.degree() - 1;
  const double scale = 2 / mesh.width(e);
  const auto at = [](int i, int j) { return static_cast<std::size_t>(i * kMost + j); };
  for (int k = 0; k < n; ++k) {
    const double w = mesh.weight(k) / scale;
    std::array<double, kMost> slope;
    for (int j = 0; j < n; ++j) slope[static_cast<std::size_t>(j)] = mesh.slope(k, j) * scale;
    for (int i = 0; i < n; ++i) {
      const double of_t = w * points[k].tptp * slope[static_cast<std::size_t>(i)],
                   of_f = kTwisted ? w * points[k].fpfp * slope[static_cast<std::size_t>(i)] : 0;
      double *t = &tptp[at(i, 0)], *f = &fpfp[at(i, 0)];
      for (int j = 0; j < n; ++j) t[j] += of_t * slope[static_cast<std::size_t>(j)];
      if constexpr (kTwisted)
        for (int j = 0; j < n; ++j) f[j] += of_f * slope[static_cast<std::size_t>(j)];
    }
    for (int j = 0; j < n; ++j) {
      ttp[at(k, j)] = w * points[k].ttp * slope[static_cast<std::size_t>(j)];
      if constexpr (kTwisted) tfp[at(k, j)] = w * points[k].tfp * slope[static_cast<std::size_t>(j)];
    }
    ttp[at(k, k)] += 0.5 * w * (points[k].tt + electric * points[k].q_tt);
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) {
      const int row = (base + i) * kEach, column = (base + j) * kEach;
      if (column < 0 || row >= inner * kEach) continue;
      hessian(row, column) += tptp[at(i, j)] + ttp[at(i, j)] + ttp[at(j, i)];
      if constexpr (kTwisted) {
        hessian(row + 1, column + 1) += fpfp[at(i, j)];
        hessian(row + 1, column) += tfp[at(j, i)];
        if (i != j) hessian(row, column + 1) += tfp[at(i, j)];
      }
    }
}

template <bool kTwisted, class R>
Slopes<R> slopes(const CellForces<R>& p, const DirectorMesh& mesh, const std::vector<R>& t, const std::vector<R>& f,
                 SymmetricBand* hessian) {
  constexpr int kEach = kTwisted ? 2 : 1;
  const int n = mesh.degree() + 1, inner = mesh.free_nodes();
  Slopes<R> r;
  r.gradient.assign(static_cast<std::size_t>(inner * kEach), R(0.0));
  r.pull.assign(r.gradient.size(), R(0.0));
  std::vector<Density<R>> points(static_cast<std::size_t>(mesh.nodes() + mesh.elements()));
  // The electric energy's slope by Q needs Q first.
  for (int e = 0; e < mesh.elements(); ++e) {
    const double scale = 2 / mesh.width(e);
    const std::size_t base = static_cast<std::size_t>(e * mesh.degree());
    for (int k = 0; k < n; ++k) {
      R tp(0.0), fp(0.0);
      for (int j = 0; j < n; ++j) {
        const double d = mesh.slope(k, j) * scale;
        tp = tp + d * t[base + static_cast<std::size_t>(j)];
        if constexpr (kTwisted) fp = fp + d * f[base + static_cast<std::size_t>(j)];
      }
      const R& here = t[base + static_cast<std::size_t>(k)];
      Density<R>& point = points[static_cast<std::size_t>(e * n + k)];
      point = hessian ? density<kTwisted, true>(p, here, tp, fp) : density<kTwisted, false>(p, here, tp, fp);
      const double w = mesh.weight(k) / scale;
      r.energy = r.energy + w * point.e;
      r.q = r.q + w * point.q;
    }
  }
  const R room = inverse(1.0 - p.gamma * r.q);
  r.energy = r.energy - 0.5 * p.drive * r.q * room;
  const R electric = -0.5 * p.drive * room * room;
  for (int e = 0; e < mesh.elements(); ++e) {
    const double scale = 2 / mesh.width(e);
    const int base = e * mesh.degree() - 1;  // of the unknowns
    for (int k = 0; k < n; ++k) {
      const Density<R>& point = points[static_cast<std::size_t>(e * n + k)];
      const double w = mesh.weight(k) / scale;
      const int row = base + k;
      if (row >= 0 && row < inner) {
        const std::size_t i = static_cast<std::size_t>(row * kEach);
        r.gradient[i] = r.gradient[i] + w * (point.e_t + electric * point.q_t);
        r.pull[i] = r.pull[i] + w * point.q_t;
      }
      for (int j = 0; j < n; ++j) {
        const int other = base + j;
        if (other < 0 || other >= inner) continue;
        const double d = mesh.slope(k, j) * scale * w;
        const std::size_t i = static_cast<std::size_t>(other * kEach);
        r.gradient[i] = r.gradient[i] + d * point.e_tp;
        if constexpr (kTwisted) r.gradient[i + 1] = r.gradient[i + 1] + d * point.e_fp;
      }
    }
    if constexpr (std::is_same_v<R, double>)
      if (hessian) add_element<kTwisted>(mesh, e, &points[static_cast<std::size_t>(e * n)], electric, *hessian);
  }
  // In the middle of a mirrored profile the tilt is free, the azimuth half of the twist.
  if (kTwisted && mesh.is_half()) {
    r.gradient.back() = R(0.0);
    if (hessian) hessian->fix(inner * kEach - 1);
  }
  return r;
}

/// The Hessian is a band less a rank-one part: curvature (<= 0) times pull pull^T.
struct Newton {
  SymmetricBand band;
  std::vector<double> pull, band_pull;
  double curvature;
  Newton(SymmetricBand b, std::vector<double> a, double c) : band(std::move(b)), pull(std::move(a)), curvature(c) {}
  void prepare() {
    band_pull = pull;
    band.solve(band_pull);
  }
  /// > 0: positive definite with the rank-one part
  double room() const { return 1 + curvature * dot(pull, band_pull); }
  /// H x = b by Sherman and Morrison.
  void solve(std::vector<double>& b, bool with_rank_one = true) const {
    band.solve(b);
    if (!with_rank_one) return;
    const double along = curvature * dot(pull, b) / room();
    for (std::size_t i = 0; i < b.size(); ++i) b[i] -= along * band_pull[i];
  }
};

double curvature_by_q(const CellForces<double>& p, double q) {
  const double room = 1 / (1 - p.gamma * q);
  return -p.drive * p.gamma * room * room * room;
}

int band_width(const DirectorMesh& mesh, bool twisted) { return twisted ? 2 * mesh.degree() + 1 : mesh.degree(); }

template <bool kTwisted>
DirectorSolution solve(const CellForces<double>& p, const DirectorMesh& mesh, std::vector<double> t,
                       std::vector<double> f) {
  constexpr int kEach = kTwisted ? 2 : 1;
  constexpr int kMostIterations = 200;
  const int unknowns = mesh.free_nodes() * kEach;
  DirectorSolution result;
  double before = 0;
  const auto moved = [&](const std::vector<double>& from, const std::vector<double>& step, double share, int offset) {
    std::vector<double> to = from;
    for (int i = 0; i < mesh.free_nodes(); ++i)
      to[static_cast<std::size_t>(i + 1)] += share * step[static_cast<std::size_t>(i * kEach + offset)];
    return to;
  };
  SymmetricBand band(unknowns, band_width(mesh, kTwisted));
  Slopes<double> here = slopes<kTwisted, double>(p, mesh, t, f, &band);
  for (int iteration = 1; iteration <= kMostIterations; ++iteration) {
    Newton newton(band, here.pull, curvature_by_q(p, here.q));
    // away from the minimum: steepest descent, the more the worse
    for (double shift = 1e-3; !newton.band.factor(); shift *= 10) {
      newton.band = band;
      newton.band.add_to_diagonal(shift);
    }
    newton.prepare();
    std::vector<double> step = here.gradient;
    for (double& x : step) x = -x;
    newton.solve(step, newton.room() > 1e-3);
    double largest = 0;  // turn of the director; an azimuth near the normal means little and is known as little
    for (std::size_t i = 0; i < step.size(); ++i)
      largest = std::max(largest, std::abs(step[i]) * (kTwisted && i % 2 == 1 ? std::cos(t[i / 2 + 1]) : 1.0));
    const double descent = dot(step, here.gradient);
    // No step turns the director by more than a radian.
    double share = std::min(1.0, 1 / largest);
    result.iterations = iteration;
    result.energy = here.energy;
    // The last steps are below the rounding of the energy, which can judge them no more. Each is some number times the
    // one before squared: done where the next one would not show. Near the normal the azimuth is known to rounding over
    // cos^2 of the tilt: steps that no longer shrink are its last digits.
    const bool last = largest < 1e-5, first = iteration == 1;
    const double next = first ? largest : largest * std::min(1.0, std::pow(largest / before, 2));
    const bool done = last && (largest < 1e-11 || next < 1e-12 || (!first && largest > 0.25 * before));
    before = largest;
    std::vector<double> next_t = moved(t, step, share, 0), next_f = kTwisted ? moved(f, step, share, 1) : f;
    if (done) {
      result.tilt = std::move(next_t);
      result.azimuth = std::move(next_f);
      return result;
    }
    const double energy = here.energy;
    // Most steps are taken whole: what the next one needs is worked out with the energy that judges this one.
    band = SymmetricBand(unknowns, band_width(mesh, kTwisted));
    here = slopes<kTwisted, double>(p, mesh, next_t, next_f, &band);
    bool halved = false;
    for (int halvings = 0; !last && halvings < 60; ++halvings, halved = true) {
      if (here.energy <= energy + 1e-4 * share * descent + 1e-13 * std::abs(energy)) break;
      share *= 0.5;
      next_t = moved(t, step, share, 0);
      if (kTwisted) next_f = moved(f, step, share, 1);
      here = slopes<kTwisted, double>(p, mesh, next_t, next_f, nullptr);
    }
    t = std::move(next_t);
    f = std::move(next_f);
    if (halved) {
      band = SymmetricBand(unknowns, band_width(mesh, kTwisted));
      here = slopes<kTwisted, double>(p, mesh, t, f, &band);
    }
  }
  throw UserError(Where{}, "the director of this cell has no equilibrium that could be found",
                  "check the voltage, the elastic constants and the twist of sample.cell.director.freedericksz");
}

/// Between faces alike a cell is its own mirror image: the tilt the same, the azimuth as far before the exit as after
/// the entry. Half of it tells the whole.
template <class S>
bool is_mirrored(const CellForces<S>& p) {
  return p.tilt_entry == p.tilt_exit;
}
template <class S, int N>
bool is_mirrored(const CellForces<Dual<S, N>>& p) {
  return p.tilt_entry.value == p.tilt_exit.value && p.tilt_entry.d == p.tilt_exit.d;
}
std::vector<double> first_half(const std::vector<double>& whole) {
  return {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>((whole.size() + 1) / 2)};
}
/// `mirror` of what stands as far from the middle on the other side.
template <class T, class Mirror>
void complete(std::vector<T>& half, const Mirror& mirror) {
  for (std::size_t i = half.size(); i-- > 1;) half.push_back(mirror(half[i - 1]));
}

template <bool kTwisted, int N>
void tangents(const CellForces<Dual<double, N>>& p, const DirectorMesh& mesh, const std::vector<double>& tilts,
              const std::vector<double>& azimuths, std::vector<std::array<double, N>>& tilt,
              std::vector<std::array<double, N>>& azimuth) {
  constexpr int kEach = kTwisted ? 2 : 1;
  using D = Dual<double, N>;
  CellForces<double> plain_forces{p.k33.value,       p.k22.value,       p.gamma.value,
                                  p.drive.value,     p.chirality.value, p.tilt_entry.value,
                                  p.tilt_exit.value, p.twist.value,     p.twisted};
  const int unknowns = mesh.free_nodes() * kEach;
  SymmetricBand band(unknowns, band_width(mesh, kTwisted));
  const Slopes<double> here = slopes<kTwisted, double>(plain_forces, mesh, tilts, azimuths, &band);
  Newton newton(std::move(band), here.pull, curvature_by_q(plain_forces, here.q));
  const bool stable = newton.band.factor();
  if (stable) newton.prepare();
  std::vector<D> t(tilts.begin(), tilts.end()), f(azimuths.begin(), azimuths.end());
  t.front() = p.tilt_entry;
  if (!mesh.is_half()) t.back() = p.tilt_exit;
  const D azimuth_exit = mesh.is_half() ? 0.5 * p.twist : p.twist;
  if (kTwisted) f.back() = azimuth_exit;
  const Slopes<D> moved = slopes<kTwisted, D>(p, mesh, t, f, nullptr);
  tilt.assign(t.size(), {});
  azimuth.assign(kTwisted ? t.size() : 0, {});
  for (std::size_t d = 0; d < static_cast<std::size_t>(N); ++d) {
    std::vector<double> change(static_cast<std::size_t>(unknowns));
    for (std::size_t i = 0; i < change.size(); ++i) change[i] = -moved.gradient[i].d[d];
    if (stable)
      newton.solve(change);
    else
      std::fill(change.begin(), change.end(), 0.0);  // at the very threshold of a cell without pretilt no slope exists
    for (std::size_t i = 0; i < static_cast<std::size_t>(mesh.free_nodes()); ++i) {
      tilt[i + 1][d] = change[i * kEach];
      if constexpr (kTwisted) azimuth[i + 1][d] = change[i * kEach + 1];
    }
    tilt.front()[d] = p.tilt_entry.d[d];
    if (!mesh.is_half()) tilt.back()[d] = p.tilt_exit.d[d];
    if constexpr (kTwisted) azimuth.back()[d] = azimuth_exit.d[d];
  }
}

}  // namespace

const DirectorMesh& cell_mesh() {
  static const DirectorMesh mesh(16, 10);
  return mesh;
}

namespace {

DirectorSolution solve_from_start(const CellForces<double>& p, const DirectorMesh& mesh) {
  std::vector<double> t, f;
  const double entry = p.tilt_entry, exit = p.tilt_exit;
  // What a planar cell does for deps > 0 a homeotropic one does for deps < 0, with bend for splay, measured from the
  // normal.
  const bool falls = p.drive < 0;
  double stiffness = falls ? p.k33 : 1;
  if (p.twisted && !falls)
    stiffness += ((p.k33 - 2 * p.k22) * p.twist * p.twist + 2 * p.k22 * p.chirality * p.twist) / (kPi * kPi);
  const double v = std::sqrt(std::abs(p.drive) / std::max(stiffness, 1e-2)) / kPi;
  const bool even = std::abs(entry - exit) < 0.5;
  const double mean = 0.5 * (entry + exit), side = falls ? (mean > kPi / 2 ? -1 : 1) : (mean < 0 ? -1 : 1),
               upright = kPi / 2;
  const EllipticStart start(even ? v : 0, side * (falls ? upright - mean : mean));
  for (int i = 0; i < mesh.nodes(); ++i) {
    const double zeta = mesh.place(i), linear = entry + (exit - entry) * zeta;
    const double swung = falls ? upright - side * start.at(zeta) : side * start.at(zeta);
    t.push_back(even ? swung + linear - mean : linear);
  }
  t.front() = entry;
  if (!mesh.is_half()) t.back() = exit;
  if (!p.twisted) return solve<false>(p, mesh, std::move(t), {});
  // The azimuth that this tilt would have: (flux) / stiffness against twist, the chiral part included.
  f.assign(t.size(), 0.0);
  std::vector<double> yielding(t.size()), driven(t.size());
  const auto rate = [&](std::size_t i) {
    const double c = std::cos(t[i]), s = std::sin(t[i]), stiff = p.k22 * c * c + p.k33 * s * s;
    return std::pair(1 / (c * c * stiff + 1e-6), p.k22 * p.chirality / stiff);
  };
  for (std::size_t i = 1; i < t.size(); ++i) {
    const double h = mesh.place(static_cast<int>(i)) - mesh.place(static_cast<int>(i) - 1);
    const auto [a, b] = rate(i - 1);
    const auto [c, d] = rate(i);
    yielding[i] = yielding[i - 1] + 0.5 * h * (a + c);
    driven[i] = driven[i - 1] + 0.5 * h * (b + d);
  }
  const double azimuth_exit = (mesh.is_half() ? 0.5 : 1) * p.twist;
  const double flux = (azimuth_exit - driven.back()) / yielding.back();
  for (std::size_t i = 1; i < t.size(); ++i) f[i] = driven[i] + flux * yielding[i];
  f.back() = azimuth_exit;
  return solve<true>(p, mesh, std::move(t), std::move(f));
}

/// Plans, passes over groups of derivatives and changes of anything but the director ask for the same one again and
/// again.
struct KnownDirectors : Recent<std::array<double, 9>, DirectorSolution> {
  KnownDirectors() : Recent(4096) {}  // 10 to 20 MB
};

}  // namespace

DirectorSolution solve_director(const CellForces<double>& forces, const DirectorMesh& mesh) {
  const std::optional<DirectorMesh> half = is_mirrored(forces) ? mesh.half() : std::nullopt;
  if (!half) return solve_from_start(forces, mesh);
  DirectorSolution solution = solve_from_start(forces, *half);
  complete(solution.tilt, [](double tilt) { return tilt; });
  complete(solution.azimuth, [&](double azimuth) { return forces.twist - azimuth; });
  return solution;
}

std::shared_ptr<const DirectorSolution> known_director(const CellForces<double>& p, Memo* memo) {
  const std::array<double, 9> key{
      p.k33, p.k22, p.gamma, p.drive, p.chirality, p.tilt_entry, p.tilt_exit, p.twist, p.twisted ? 1.0 : 0.0};
  return remembered<KnownDirectors>(memo, key,
                                    [&] { return std::make_shared<DirectorSolution>(solve_director(p, cell_mesh())); });
}

template <int N>
void director_tangents(const CellForces<Dual<double, N>>& forces, const DirectorMesh& mesh,
                       const DirectorSolution& solution, std::vector<std::array<double, N>>& tilt,
                       std::vector<std::array<double, N>>& azimuth) {
  const std::optional<DirectorMesh> half = is_mirrored(forces) ? mesh.half() : std::nullopt;
  const DirectorMesh& of = half ? *half : mesh;
  const std::vector<double> tilts = half ? first_half(solution.tilt) : solution.tilt,
                            azimuths = half ? first_half(solution.azimuth) : solution.azimuth;
  if (forces.twisted)
    tangents<true, N>(forces, of, tilts, azimuths, tilt, azimuth);
  else
    tangents<false, N>(forces, of, tilts, azimuths, tilt, azimuth);
  if (!half) return;
  using Slope = std::array<double, static_cast<std::size_t>(N)>;
  complete(tilt, [](const Slope& slope) { return slope; });
  complete(azimuth, [&](const Slope& slope) {
    Slope mirrored;
    for (std::size_t i = 0; i < slope.size(); ++i) mirrored[i] = forces.twist.d[i] - slope[i];
    return mirrored;
  });
}
template void director_tangents<1>(const CellForces<Dual<double, 1>>&, const DirectorMesh&, const DirectorSolution&,
                                   std::vector<std::array<double, 1>>&, std::vector<std::array<double, 1>>&);
template void director_tangents<2>(const CellForces<Dual<double, 2>>&, const DirectorMesh&, const DirectorSolution&,
                                   std::vector<std::array<double, 2>>&, std::vector<std::array<double, 2>>&);
template void director_tangents<8>(const CellForces<Dual<double, 8>>&, const DirectorMesh&, const DirectorSolution&,
                                   std::vector<std::array<double, 8>>&, std::vector<std::array<double, 8>>&);
template void director_tangents<4>(const CellForces<Dual<double, 4>>&, const DirectorMesh&, const DirectorSolution&,
                                   std::vector<std::array<double, 4>>&, std::vector<std::array<double, 4>>&);

}  // namespace birefit
