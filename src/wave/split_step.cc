#include "wave/split_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <system_error>

#include "core/threads.h"
#include "transport/method.h"
#include "wave/slab_point.h"

namespace birefit {
namespace {

using Z = std::complex<double>;

/// Complex numbers, one a lane, with only what is needed below: real and imaginary parts apart, so that coefficients
/// are plain packs.
struct Lanes {
  Pack re, im;
};
BIREFIT_INLINE Lanes operator+(const Lanes& a, const Lanes& b) { return {a.re + b.re, a.im + b.im}; }
BIREFIT_INLINE Lanes operator-(const Lanes& a, const Lanes& b) { return {a.re - b.re, a.im - b.im}; }
BIREFIT_INLINE Lanes operator*(const Pack& a, const Lanes& b) { return {a * b.re, a * b.im}; }
BIREFIT_INLINE Lanes operator*(const Lanes& a, const Lanes& b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
using Interleaved = xsimd::batch<Z, Pack::arch_type>;
/// The `count` numbers from here on; zeros in lanes beyond.
BIREFIT_INLINE Lanes load(const Z* from, int count) {
  Z some[kLanes] = {};
  if (count < kLanes) {
    std::copy_n(from, count, some);
    from = some;
  }
  const Interleaved z = Interleaved::load_unaligned(from);
  return {z.real(), z.imag()};
}
BIREFIT_INLINE void store(const Lanes& a, Z* to, int count) {
  if (count == kLanes) return Interleaved(a.re, a.im).store_unaligned(to);
  Z some[kLanes];
  Interleaved(a.re, a.im).store_unaligned(some);
  std::copy_n(some, count, to);
}
/// f(first, count) for [0, n) in pieces of one pack.
template <class F>
void in_packs(std::size_t n, const F& f) {
  for (std::size_t i = 0; i < n; i += kLanes) f(i, static_cast<int>(std::min<std::size_t>(kLanes, n - i)));
}
/// What packs read with load_unaligned may be read beyond the end.
std::vector<double> padded(std::vector<double> x) {
  x.resize(x.size() + kLanes);
  return x;
}

/// The walk of a worker through work that all share: phases end at a barrier.
struct Crew {
  Barrier& barrier;
  int worker, workers;
  template <class F>
  void each(int n, const F& f) const {
    for (int i = worker; i < n; i += workers) f(i);
    barrier.arrive_and_wait();
  }
};

/// p and s component of a transverse field by these factors.
template <class S>
void scale_p_and_s(const WaveLight<S>& light, const S& p_factor, const S& s_factor, Complex<S>& x, Complex<S>& y) {
  const double f = 1 / std::hypot(light.kx_per_um, light.ky_per_um);
  const S px(f * light.kx_per_um), py(f * light.ky_per_um);
  const Complex<S> p = p_factor * (px * x + py * y), s = s_factor * (px * y - py * x);
  x = px * p - py * s;
  y = py * p + px * s;
}
/// (q / n_host)^(1/2).
template <class S>
S root_of_cosine(const WaveLight<S>& light) {
  const S kn = light.k0_per_um * light.n_host;
  const double k2 = square(light.kx_per_um) + square(light.ky_per_um);
  return root(S(root(S(kn * kn - k2)) * inverse(kn)));
}

template <class S>
class Propagation {
 public:
  static constexpr int kFields = 1 + ScalarTraits<S>::derivatives;
  Propagation(const WaveGrid& grid, const WaveLight<S>& light, const WaveMedium<S>& medium)
      : g_(grid),
        light_(light),
        medium_(medium),
        fft_(grid.nx, grid.ny),
        n_(fft_.size()),
        blocks_((static_cast<std::size_t>(grid.nx) + kLanes - 1) / kLanes),
        h_((grid.exit_um - grid.entry_um) / grid.slabs) {
    for (auto& field : fields_)
      for (Plane* plane : {&field.a[0], &field.a[1], &field.term[0], &field.term[1]}) plane->resize(n_);
    for (auto& field : fields_)
      for (Plane& plane : field.work) plane.resize(n_);
    const std::size_t blocks = blocks_ * static_cast<std::size_t>(grid.ny) * kFields * kLanes;
    screen_.resize(blocks * kScreens);
    for (Table& table : oblique_) table.resize(blocks * kObliques);
    screen_is_hosts_.resize(blocks_ * static_cast<std::size_t>(grid.ny));
    for (auto& halves : hosts_halves_) halves.assign(blocks_ * static_cast<std::size_t>(grid.ny), 0);
    const auto wavenumbers = [&](int n, double tilt) {
      std::vector<double> k(static_cast<std::size_t>(n));
      for (int m = 0; m < n; ++m)
        k[static_cast<std::size_t>(m)] =
            tilt + (n == 1 ? 0.0 : 2 * std::numbers::pi / (n * g_.step_um) * (m < n - m ? m : m - n));
      return k;
    };
    kx_ = wavenumbers(g_.nx, light.kx_per_um);
    ky_ = wavenumbers(g_.ny, light.ky_per_um);
    const double k0 = first(light.k0_per_um);
    half_step_.resize(n_);
    half_step_slope_.resize(n_);
    kept_.resize(n_);
    const double kn = k0 * g_.n_ref;
    for (std::size_t i = 0; i < n_; ++i) {
      const double k2 = square(kx_[i % kx_.size()]) + square(ky_[i / kx_.size()]);
      if (k2 > square(g_.cut_per_um)) continue;  // zero: cut
      const double q = std::sqrt(kn * kn - k2), phase = 0.5 * h_ * (q - kn);
      kept_[i] = 1;
      half_step_[i] = std::polar(1.0, phase);
      half_step_slope_[i] = 0.5 * h_ * (k0 * square(g_.n_ref) / q - g_.n_ref);
    }
    kx_ = padded(kx_), kept_ = padded(kept_), half_step_slope_ = padded(half_step_slope_);
    frame_x_ = padded(frame(g_.nx)), frame_y_ = frame(g_.ny);
    incident_[0] = light.ex, incident_[1] = light.ey;
    const S kh = light.k0_per_um * light.n_host;
    tilt2_ = square(light.kx_per_um) + square(light.ky_per_um);
    host_q_ = root(kh * kh - tilt2_) * inverse(light.k0_per_um);
    field_to_flux(light, incident_[0], incident_[1]);
    host_ = OpticalPoint<S>{
        {S(0.0), S(0.0), S(1.0)}, light.n_host * light.n_host, light.n_host * light.n_host, S(0.0), S(0.0), S(0.0)};
    host_slab_ = slab_point(g_.layers, h_, light.k0_per_um, g_.n_ref, [&](int) { return host_; });
    felt_.assign(static_cast<std::size_t>(g_.ny) * kFields, 0);
    put_screen(host_slab_, host_screen_.data(), felt_.data());
    for (int halves = 0; halves < 4; ++halves) {
      double* to = host_oblique_[static_cast<std::size_t>(halves)].data();
      std::fill_n(to, kObliques * kFields * kLanes, 0.0);
      for (int half = 0; half < 2; ++half)
        if (halves >> half & 1) put_oblique(host_slab_.half[half], to, to, felt_.data());
    }
    for (int f = 0; f < kFields; ++f)
      host_feels_[static_cast<std::size_t>(f)] = f == 0 || felt_[static_cast<std::size_t>(f)];
    awake_[0] = 1;
    for (int f = 1; f < kFields; ++f)
      awake_[static_cast<std::size_t>(f)] =
          part(light.k0_per_um, f) != 0 || part(incident_[0], f) != Z(0) || part(incident_[1], f) != Z(0);
    for (int a = 0; a < 2; ++a)
      for (int f = 0; f < kFields; ++f) {
        std::fill(fields_[f].a[a].begin(), fields_[f].a[a].end(), Z(0));
        fields_[f].a[a][0] = part(incident_[a], f) * static_cast<double>(n_);  // of the transform
      }
  }

  std::vector<WaveField> run(int threads) {
    while (!runs_with(threads)) threads /= 2;
    return scattered();
  }

 private:
  /// False, and nothing was done, where there are not so many threads to be had.
  bool runs_with(int threads) try {
    Barrier barrier(threads);
    run_together(threads, [&](int t) {
      const Crew crew{barrier, t, threads};
      for (int slab = 0; slab <= g_.slabs; ++slab) {
        if (slab < g_.slabs) crew.each(g_.ny, [&](int row) { sample_row(slab, row); });
        if (t == 0) wake();
        crew.barrier.arrive_and_wait();
        for (int order = 1; order <= g_.order; ++order) oblique(crew, slab, order);
        if (t == 0) incident_oblique(slab);
        if (slab < g_.slabs) pass_screen(crew);
        if (t == 0 && slab < g_.slabs) pass_incident();
      }
      crew.each(2 * kFields, [&](int job) { fft_.inverse(fields_[static_cast<std::size_t>(job / 2)].a[job % 2]); });
    });
    return true;
  } catch (const std::system_error&) {
    if (threads <= 1) throw;
    return false;
  }

  /// By pieces of a row, one pack of points each: [row][piece][quantity][value or derivative].
  using Table = std::vector<double, AlignedAllocator<double>>;
  struct Field {
    Plane a[2];     ///< spectrum
    Plane term[2];  ///< of the Taylor series
    Plane work[6];
  };

  static double first(const S& x) { return lane(plain(x), 0); }
  /// Value (f = 0) or derivative f - 1.
  static double part(const S& x, int f) {
    if constexpr (kFields > 1)
      if (f > 0) return lane(x.d[static_cast<std::size_t>(f - 1)], 0);
    (void)f;
    return first(x);
  }
  static Z part(const Complex<S>& x, int f) { return {part(x.re, f), part(x.im, f)}; }
  static const PlainOf<S>& lanes(const S& x, int f) {
    if constexpr (kFields > 1) {
      return f == 0 ? x.value : x.d[static_cast<std::size_t>(f - 1)];
    } else {
      return x;
    }
  }
  /// Attenuation of the scattered field in one slab.
  std::vector<double> frame(int n) const {
    std::vector<double> r(static_cast<std::size_t>(n), 1.0);
    if (g_.frame_um <= 0 || n == 1) return r;
    for (int i = 0; i < n; ++i) {
      const double edge = 0.5 * n * g_.step_um, x = std::abs((i + 0.5 - 0.5 * n) * g_.step_um),
                   inside = (x - (edge - g_.frame_um)) / g_.frame_um;
      if (inside > 0) r[static_cast<std::size_t>(i)] = std::exp(-kAbsorption * h_ * square(inside));
    }
    return r;
  }
  /// 1/um at the outer edge: strong enough over a frame, weak enough not to reflect
  static constexpr double kAbsorption = 1.5;

  /// Parameters that the light has not met yet, or never will (where the picture lies), cost nothing.
  void wake() {
    for (std::size_t k = 0; k < felt_.size(); ++k) awake_[k % kFields] |= felt_[k];
  }
  bool asleep(int f) const { return !awake_[static_cast<std::size_t>(f)]; }
  bool host_feels(int f) const { return host_feels_[static_cast<std::size_t>(f)]; }

  /// Of one piece.
  static Pack entry(const double* piece, int quantity, int field) {
    return Pack::load_aligned(piece + (quantity * kFields + field) * kLanes);
  }
  std::size_t piece(int row, std::size_t first) const {
    return static_cast<std::size_t>(row) * blocks_ + first / kLanes;
  }

  void sample_row(int slab, int row) {
    alignas(64) double x[kLanes];
    const Pack y(g_.y_um(row));
    const auto depth = [&](int layer) { return g_.entry_um + (slab + layer_depth(layer, g_.layers)) * h_; };
    for (int i = 0; i < g_.nx; i += kLanes) {
      const int count = std::min(kLanes, g_.nx - i);
      for (int k = 0; k < kLanes; ++k) x[k] = g_.x_um(i + std::min(k, count - 1));
      const Pack place = Pack::load_aligned(x);
      bool host = true;
      for (int l = 0; l < g_.layers && host; ++l) host = !medium_.reaches(place, y, depth(l));
      const std::size_t n = static_cast<std::size_t>(row) * blocks_ + static_cast<std::size_t>(i / kLanes);
      screen_is_hosts_[n] = host;
      if (host)
        keep_host(slab, n);
      else
        keep(slab_point(g_.layers, h_, light_.k0_per_um, g_.n_ref,
                        [&](int l) { return medium_.at(place, y, depth(l)); }),
             slab, row, n);
    }
  }
  /// Most of the box is host, the same at all points: what is kept of it is that it is host, lest tables be read that
  /// no cache holds.
  void keep_host(int slab, std::size_t n) {
    if (char& halves = hosts_halves_[slab % 2][n]; halves != kOwn)
      halves |= 1;
    else
      put_oblique(host_slab_.half[0], oblique_piece(slab, n), oblique_piece(slab, n), nullptr);
    hosts_halves_[(slab + 1) % 2][n] = 2;
  }
  void keep(const SlabPoint<S>& p, int slab, int row, std::size_t n) {
    char* felt = felt_.data() + row * kFields;
    put_screen(p, screen_.data() + n * kScreens * kPiece, felt);
    for (int half = 0; half < 2; ++half) {
      char& halves = hosts_halves_[(slab + half) % 2][n];
      double* to = oblique_piece(slab + half, n);
      put_oblique(p.half[half], half == 0 ? oblique_at_piece(slab, n) : host_oblique_[0].data(), to, felt);
      halves = kOwn;
    }
  }
  /// What is known of V' about a slab's entry there.
  const double* oblique_at_piece(int slab, std::size_t n) const {
    const char halves = hosts_halves_[slab % 2][n];
    return halves == kOwn ? oblique_[slab % 2].data() + n * kObliques * kPiece
                          : host_oblique_[static_cast<std::size_t>(halves)].data();
  }
  double* oblique_piece(int slab, std::size_t n) { return oblique_[slab % 2].data() + n * kObliques * kPiece; }

  void put(double* to, const S& x, const double* before, char* felt) const {
    for (int f = 0; f < kFields; ++f) {
      if (f > 0 && felt && !felt[f]) felt[f] = xsimd::any(lanes(x, f) != Pack(0.0));
      const Pack all = before ? Pack::load_aligned(before + f * kLanes) + lanes(x, f) : lanes(x, f);
      all.store_aligned(to + f * kLanes);
    }
  }
  void put_screen(const SlabPoint<S>& p, double* to, char* felt) const {
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b) {
        put(to + (4 * a + 2 * b) * kPiece, p.screen[a][b].re, nullptr, felt);
        put(to + (4 * a + 2 * b + 1) * kPiece, p.screen[a][b].im, nullptr, felt);
      }
  }
  /// to <- before + o
  void put_oblique(const ObliquePoint<S>& o, const double* before, double* to, char* felt) const {
    const auto set = [&](int quantity, const S& x) {
      put(to + quantity * kPiece, x, before + quantity * kPiece, felt);
    };
    set(kWalk, o.v[0]), set(kWalk + 1, o.v[1]), set(kSd, o.sd), set(kSc, o.sc);
    for (int ij = 0; ij < 3; ++ij)
      for (int ab = 0; ab < 3; ++ab) set(kD + 3 * ij + ab, o.d[ij][ab]);
  }

  /// V' at one point on a, kx a, ky a in real space (`in`: ax, ay, kx ax, ky ax, kx ay, ky ay), with the f-th
  /// coefficients: adds what stays as it is (out 0, 1) and what kx, ky will be applied to (out 2 .. 5, the same order).
  BIREFIT_INLINE static void oblique_at(const double* coefficients, int f, const Lanes* in, Lanes* out) {
    const auto c = [&](int quantity) { return entry(coefficients, quantity, f); };
    const Lanes div = in[2] + in[5], curl = in[3] - in[4];  // kappa . a, kappa' . a
    const Pack vx = -0.5 * c(kWalk), vy = -0.5 * c(kWalk + 1);
    out[0] = out[0] + vx * div;
    out[1] = out[1] + vy * div;
    const Lanes walked = vx * in[0] + vy * in[1] - (0.5 * c(kSd)) * div, turned = (-0.5 * c(kSc)) * curl;
    Pack d[3][3];
    for (int ij = 0; ij < 3; ++ij)
      for (int ab = 0; ab < 3; ++ab) d[ij][ab] = c(kD + 3 * ij + ab);
    out[2] = out[2] + walked + d[0][0] * in[2] + d[1][0] * in[3] + d[0][1] * in[4] + d[1][1] * in[5];
    out[3] = out[3] + turned + d[1][0] * in[2] + d[2][0] * in[3] + d[1][1] * in[4] + d[2][1] * in[5];
    out[4] = out[4] - turned + d[0][1] * in[2] + d[1][1] * in[3] + d[0][2] * in[4] + d[1][2] * in[5];
    out[5] = out[5] + walked + d[1][1] * in[2] + d[2][1] * in[3] + d[1][2] * in[4] + d[2][2] * in[5];
  }

  /// term <- (i / order) V' term (of order 1: of a itself), a <- a + term.
  void oblique(const Crew& crew, int slab, int order) {
    const std::size_t nx = static_cast<std::size_t>(g_.nx);
    crew.each(6 * kFields, [&](int job) {
      if (asleep(job / 6)) return;
      Field& field = fields_[static_cast<std::size_t>(job / 6)];
      const int which = job % 6;
      const int component = which < 2 ? which : (which - 2) / 2;
      const Plane& from = order == 1 ? field.a[component] : field.term[component];
      Plane& to = field.work[which];
      for (std::size_t row = 0; row < ky_.size(); ++row) {
        const Z* in = from.data() + row * nx;
        Z* out = to.data() + row * nx;
        if (which < 2)
          std::copy_n(in, nx, out);
        else if (which % 2 == 0)
          in_packs(nx, [&](std::size_t i, int count) {
            store(Pack::load_unaligned(kx_.data() + i) * load(in + i, count), out + i, count);
          });
        else
          in_packs(nx, [&](std::size_t i, int count) { store(Pack(ky_[row]) * load(in + i, count), out + i, count); });
      }
      fft_.inverse(to);
    });
    crew.each(g_.ny, [&](int row) {
      in_packs(nx, [&](std::size_t first, int count) {
        const std::size_t n = piece(row, first);
        const double* c = oblique_at_piece(slab, n);
        const bool own_point = hosts_halves_[slab % 2][n] == kOwn;
        const std::size_t i = static_cast<std::size_t>(row) * nx + first;
        Lanes in[6];
        for (int q = 0; q < 6; ++q) in[q] = load(fields_[0].work[q].data() + i, count);
        for (int f = kFields - 1; f >= 0; --f) {
          if (asleep(f)) continue;
          Field& field = fields_[static_cast<std::size_t>(f)];
          Lanes own[6], out[6];
          for (int q = 0; q < 6; ++q) own[q] = load(field.work[q].data() + i, count), out[q] = {Pack(0.0), Pack(0.0)};
          oblique_at(c, 0, own, out);
          if (f > 0 && (own_point || host_feels(f))) oblique_at(c, f, in, out);
          for (int q = 0; q < 6; ++q) store(out[q], field.work[q].data() + i, count);
        }
      });
    });
    crew.each(6 * kFields, [&](int job) {
      if (!asleep(job / 6)) fft_.forward(fields_[static_cast<std::size_t>(job / 6)].work[job % 6]);
    });
    const Pack factor(1.0 / (order * static_cast<double>(n_)));
    crew.each(g_.ny, [&](int row) {
      const Pack ky(ky_[static_cast<std::size_t>(row)]);
      for (int of = 0; of < kFields; ++of) {
        if (asleep(of)) continue;
        Field& field = fields_[static_cast<std::size_t>(of)];
        in_packs(nx, [&](std::size_t first, int count) {
          const std::size_t i = static_cast<std::size_t>(row) * nx + first;
          const Pack kx = Pack::load_unaligned(kx_.data() + first), f = factor * Pack::load_unaligned(kept_.data() + i);
          for (int a = 0; a < 2; ++a) {
            const Lanes v = load(field.work[a].data() + i, count) + kx * load(field.work[2 + 2 * a].data() + i, count) +
                            ky * load(field.work[3 + 2 * a].data() + i, count);
            const Lanes t{-f * v.im, f * v.re};
            store(t, field.term[a].data() + i, count);
            store(load(field.a[a].data() + i, count) + t, field.a[a].data() + i, count);
          }
        });
      }
    });
  }

  BIREFIT_INLINE static Z times(const Z& a, const Z& b) {  // without the library's care for infinities
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
  }

  /// exp(i phase) over half a slab, with the derivative by the wavenumber.
  void diffract(int f, int a) {
    Plane& to = fields_[static_cast<std::size_t>(f)].a[a];
    const Plane& base = fields_[0].a[a];  // diffracted before: d exp(i phase) a = i dphase (exp(i phase) a)
    const double by_k0 = f == 0 ? 0.0 : part(light_.k0_per_um, f);
    in_packs(n_, [&](std::size_t i, int count) {
      Lanes turned = load(half_step_.data() + i, count) * load(to.data() + i, count);
      if (by_k0 != 0) {
        const Lanes b = load(base.data() + i, count);
        turned = turned + (by_k0 * Pack::load_unaligned(half_step_slope_.data() + i)) * Lanes{-b.im, b.re};
      }
      store(turned, to.data() + i, count);
    });
  }

  void pass_screen(const Crew& crew) {
    const std::size_t nx = static_cast<std::size_t>(g_.nx);
    const auto half_way = [&] {
      crew.each(2, [&](int a) { diffract(0, a); });
      if (kFields > 1)
        crew.each(2 * (kFields - 1), [&](int job) {
          if (!asleep(1 + job / 2)) diffract(1 + job / 2, job % 2);
        });
    };
    half_way();
    crew.each(2 * kFields, [&](int job) {
      if (!asleep(job / 2)) fft_.inverse(fields_[static_cast<std::size_t>(job / 2)].a[job % 2]);
    });
    Z inc[kFields][2];
    Complex<S> at_screen[2] = {incident_[0], incident_[1]};
    incident_half_step(at_screen);
    Complex<S> behind[2];
    for (int a = 0; a < 2; ++a)
      behind[a] = host_slab_.screen[a][0] * at_screen[0] + host_slab_.screen[a][1] * at_screen[1];
    for (int f = 0; f < kFields; ++f)
      for (int a = 0; a < 2; ++a) inc[f][a] = part(behind[a], f);
    const double over = 1.0 / static_cast<double>(n_);  // of the transform there and back
    crew.each(g_.ny, [&](int row) {
      in_packs(nx, [&](std::size_t first, int count) {
        const std::size_t n = piece(row, first);
        const bool own_point = !screen_is_hosts_[n];
        const double* c = own_point ? screen_.data() + n * kScreens * kPiece : host_screen_.data();
        const std::size_t i = static_cast<std::size_t>(row) * nx + first;
        const Pack frame = frame_y_[static_cast<std::size_t>(row)] * Pack::load_unaligned(frame_x_.data() + first);
        const auto at_point = [&](int f, int a) {
          return Pack(over) * load(fields_[static_cast<std::size_t>(f)].a[a].data() + i, count);
        };
        const Lanes x = at_point(0, 0), y = at_point(0, 1);
        for (int f = kFields - 1; f >= 0; --f) {
          if (asleep(f)) continue;
          const auto screen = [&](int a, int b, int of) {
            return Lanes{entry(c, 4 * a + 2 * b, of), entry(c, 4 * a + 2 * b + 1, of)};
          };
          const Lanes own_x = at_point(f, 0), own_y = at_point(f, 1);
          for (int a = 0; a < 2; ++a) {
            Lanes r = screen(a, 0, 0) * own_x + screen(a, 1, 0) * own_y;
            if (f > 0 && (own_point || host_feels(f))) r = r + screen(a, 0, f) * x + screen(a, 1, f) * y;
            const Lanes incident{Pack(inc[f][a].real()), Pack(inc[f][a].imag())};
            store(incident + frame * (r - incident), fields_[static_cast<std::size_t>(f)].a[a].data() + i, count);
          }
        }
      });
    });
    crew.each(2 * kFields, [&](int job) {
      if (!asleep(job / 2)) fft_.forward(fields_[static_cast<std::size_t>(job / 2)].a[job % 2]);
    });
    half_way();
  }

  // The incident wave through the host, by the same steps.
  void incident_oblique(int slab) {
    if (tilt2_ == 0) return;
    const S kx(light_.kx_per_um), ky(light_.ky_per_um), none(0.0);
    const ObliquePoint<S>* half = host_slab_.half;
    const S sd = (slab > 0 ? half[1].sd : none) + (slab < g_.slabs ? half[0].sd : none),
            sc = (slab > 0 ? half[1].sc : none) + (slab < g_.slabs ? half[0].sc : none);
    Complex<S> term[2] = {incident_[0], incident_[1]};
    for (int order = 1; order <= g_.order; ++order) {
      const Complex<S> div = S(-0.5 * sd) * (kx * term[0] + ky * term[1]),
                       curl = S(-0.5 * sc) * (ky * term[0] - kx * term[1]);
      const Complex<S> x = kx * div + ky * curl, y = ky * div - kx * curl;
      const S f(1.0 / order);
      term[0] = Complex<S>(S(0.0) - f * x.im, f * x.re);
      term[1] = Complex<S>(S(0.0) - f * y.im, f * y.re);
      for (int c = 0; c < 2; ++c) incident_[c] = incident_[c] + term[c];
    }
  }
  void incident_half_step(Complex<S>* a) const {
    if (tilt2_ == 0) return;
    const S kn = g_.n_ref * light_.k0_per_um;
    S s, c;
    sin_cos(0.5 * h_ * (root(kn * kn - tilt2_) - kn), s, c);
    for (int i = 0; i < 2; ++i) a[i] = Complex<S>(c, s) * a[i];
  }
  void pass_incident() {
    incident_half_step(incident_);
    const Complex<S> x = host_slab_.screen[0][0] * incident_[0] + host_slab_.screen[0][1] * incident_[1];
    incident_[1] = host_slab_.screen[1][0] * incident_[0] + host_slab_.screen[1][1] * incident_[1];
    incident_[0] = x;
    incident_half_step(incident_);
  }

  /// Less the incident wave, in units of its phase.
  std::vector<WaveField> scattered() {
    const S phase = light_.k0_per_um * (host_q_ - g_.n_ref) * (g_.exit_um - g_.entry_um);
    S s, c;
    sin_cos(phase, s, c);
    const Complex<S> back(c, S(0.0) - s);
    const double over = 1.0 / static_cast<double>(n_);
    std::vector<WaveField> out(static_cast<std::size_t>(kFields));
    for (int f = kFields - 1; f >= 0; --f)
      for (int a = 0; a < 2; ++a) {
        Plane& to = out[static_cast<std::size_t>(f)].a[a];
        to = std::move(fields_[static_cast<std::size_t>(f)].a[a]);
        const Z inc = part(incident_[a], f), turn = part(back, 0);
        for (Z& x : to) x = times(turn, over * x - inc);
        if (f == 0)
          for (int g = 1; g < kFields; ++g)  // base of the rest: i dphase of what has been turned back
            for (std::size_t i = 0; i < n_; ++i)
              out[static_cast<std::size_t>(g)].a[a][i] -= part(phase, g) * Z(-to[i].imag(), to[i].real());
      }
    return out;
  }

  const WaveGrid& g_;
  const WaveLight<S>& light_;
  const WaveMedium<S>& medium_;
  Fft2 fft_;
  std::size_t n_, blocks_;
  double h_;
  std::array<Field, static_cast<std::size_t>(kFields)> fields_;
  std::vector<char> felt_;  ///< [row][field]: some point of the row depends on the parameter
  std::array<char, static_cast<std::size_t>(kFields)> awake_{};
  static constexpr std::size_t kPiece = kFields * kLanes;  ///< numbers of a quantity
  static constexpr char kOwn = 4;
  Table screen_;      ///< of the slab
  Table oblique_[2];  ///< of V' about the slab's entry and exit, by turns
  /// [row][piece]: a piece is host_screen_; which halves of host_oblique_ it is, or kOwn
  std::vector<char> screen_is_hosts_, hosts_halves_[2];
  alignas(64) std::array<double, kScreens * kPiece> host_screen_;
  struct alignas(64) HostPiece : std::array<double, kObliques * kPiece> {};
  std::array<HostPiece, 4> host_oblique_;  ///< no half, that behind an interface (1), that before it (2), both
  std::array<char, static_cast<std::size_t>(kFields)> host_feels_{};
  std::vector<double> kx_, ky_, kept_;
  Plane half_step_;
  std::vector<double> half_step_slope_;
  std::vector<double> frame_x_, frame_y_;
  Complex<S> incident_[2];
  double tilt2_ = 0;
  S host_q_;
  OpticalPoint<S> host_;
  SlabPoint<S> host_slab_;
};

}  // namespace

template <class S>
void field_to_flux(const WaveLight<S>& light, Complex<S>& x, Complex<S>& y) {
  if (light.kx_per_um == 0 && light.ky_per_um == 0) return;
  const S root = root_of_cosine(light);
  scale_p_and_s(light, inverse(root), root, x, y);
}
template <class S>
void flux_to_field(WaveLight<S>& light) {
  if (light.kx_per_um == 0 && light.ky_per_um == 0) return;
  const S root = root_of_cosine(light);
  Complex<S> x = light.ex, y = light.ey;
  scale_p_and_s(light, root, inverse(root), x, y);
  light.ex = x, light.ey = y;
}

template <class S>
std::vector<WaveField> propagate(const WaveGrid& grid, const WaveLight<S>& light, const WaveMedium<S>& medium,
                                 int threads) {
  // A phase of work is a few hundred microseconds: more threads than a dozen would wait for each other.
  return Propagation<S>(grid, light, medium).run(std::min(thread_count(threads), 12));
}

#define BIREFIT_INSTANTIATE(S)                                                                                   \
  template std::vector<WaveField> propagate<S>(const WaveGrid&, const WaveLight<S>&, const WaveMedium<S>&, int); \
  template void field_to_flux<S>(const WaveLight<S>&, Complex<S>&, Complex<S>&);                                 \
  template void flux_to_field<S>(WaveLight<S>&);
BIREFIT_INSTANTIATE(Pack)
BIREFIT_INSTANTIATE(Dual1)
BIREFIT_INSTANTIATE(Dual2)
BIREFIT_INSTANTIATE(Dual4)

}  // namespace birefit
