#include "wave/radial_series.h"

#include <math.h>  // j0, j1 are POSIX, not std

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/quadrature.h"
#include "wave/slopes.h"

namespace birefit {
namespace {

/// sum += f a + slope plain(a) dx, the product f(x) a with dx = change(x).
template <class S>
void add(Complex<S>& sum, double f, double slope, const S& dx, const Complex<S>& a) {
  if constexpr (ScalarTraits<S>::derivatives == 0)
    sum = {sum.re + f * a.re, sum.im + f * a.im};
  else
    sum = {sum.re + (f * a.re + (slope * plain(a.re)) * dx), sum.im + (f * a.im + (slope * plain(a.im)) * dx)};
}

/// Powers of ten do not matter, overflow does.
template <class S>
RadialPair<S> scaled(const RadialPair<S>& p) {
  const double f = 1 / std::max(std::abs(plain(p.u)), std::abs(plain(p.slope)));
  return {p.u * f, p.slope * f};
}

/// Orders beyond max(n, z) where Miller's recurrence may start. Beyond the turning point psi/eta falls as
/// exp(-(4/3) sqrt(2 / z) L^(3/2)), which is 1e-16 at L = 7.3 z^(1/3); the rest is for small z and for derivatives.
int miller_margin(double z) { return 10 + static_cast<int>(9 * std::cbrt(z)); }

/// The coefficient of a mode whose inner field has tangential components in the ratio u : v at the surface, where the
/// host's waves have psi : psi_v and eta : eta_v. N / (N + i M) with real N, M, so |1 - 2 a| = 1 whatever their errors.
template <class S>
Complex<S> coefficient(const S& u, const S& v, const S& psi, const S& psi_v, const S& eta, const S& eta_v) {
  const S n = u * psi_v - v * psi, m = u * eta_v - v * eta;
  const S over = n * inverse(n * n + m * m);
  return {n * over, -(m * over)};
}

}  // namespace

template <class S>
RadialPair<S> regular_pair(const S& nu, const S& z) {
  // Miller's downward recurrence f_(k-1) = (2 (nu + k) + 1) / z f_k - f_(k+1): the continued fraction of psi'/psi
  // without its divisions, so that zeros of psi do no harm.
  const int start = static_cast<int>(std::max(plain(z) - plain(nu), 0.0)) + miller_margin(plain(z));
  const S over = inverse(z), step = 2.0 * over, first = (2.0 * nu + 1.0) * over;
  S above(0.0), here(1e-20);
  for (int k = start; k > 0; --k) {
    const S below = (first + step * static_cast<double>(k)) * here - above;
    above = here;
    here = below;
  }
  return scaled(RadialPair<S>{here, (nu + 1.0) * over * here - above});
}

template <class S>
RadialPair<S> carried(const RadialPair<S>& from, const S& lambda, const S& z_from, const S& z_to) {
  // Taylor steps z -> z (1 + s). Not longer than 1/5 of the way to the singularity at z = 0 nor than 4 radians (or
  // e-folds), for which kTerms reach 4^34 / 34! = 1e-18. Outwards the regular solution is the growing one, so errors do
  // not grow past it.
  constexpr int kTerms = 34;
  RadialPair<S> here = from;
  S z = z_from;
  for (bool last = false; !last;) {
    const double at = plain(z), rest = plain(z_to) - at;
    const double step = std::min(0.2 * at, 4 / std::max(1.0, std::sqrt(std::max(plain(lambda), 0.0)) / at));
    last = step >= rest;
    // The last step ends at z_to itself, whose derivatives it thereby takes on; inner stops need none of their own.
    const S next = last ? z_to : z + step;
    const S h = next - z, over = inverse(z), s = h * over, far = h * (1.0 - lambda * over * over), s_over = s * over,
            hs = 2.0 * h * s, hss = h * s * s;
    // With d_j = h^j u^(j) / j! the equation, (1 + s)^2 z^2 u'' + ((1 + s)^2 z^2 - lambda) u = 0, gives each term of
    // the slope from those before; written without a division by h, which may vanish.
    S d0(0.0), d1(0.0), d2 = here.u, d3 = here.slope * h;  // d_(j-2) .. d_(j+1)
    S u = d2 + d3, slope = here.slope;
    for (int j = 0; j < kTerms; ++j) {
      const S term = (-1.0 / (j + 1)) *
                     ((2.0 * j * (j + 1)) * over * d3 + (j * (j - 1.0) * s_over + far) * d2 + hs * d1 + hss * d0);
      d0 = d1, d1 = d2, d2 = d3, d3 = (1.0 / (j + 2)) * h * term;
      slope += term;
      u += d3;
    }
    here = scaled(RadialPair<S>{u, slope});
    z = next;
  }
  return here;
}

template <class S>
RiccatiBessel<S> riccati_bessel(const S& x, int orders) {
  const std::size_t size = static_cast<std::size_t>(orders) + 1;
  RiccatiBessel<S> r{std::vector<S>(std::max<std::size_t>(size, 2)), std::vector<S>(std::max<std::size_t>(size, 2))};
  const S over = inverse(x);
  S s, c;
  sin_cos(x, s, c);
  const S psi0 = s, psi1 = s * over - c;
  // psi downwards and to scale by its first two, which never vanish together; eta upwards. Both ways are the stable
  // ones.
  S above(0.0), here(1e-100);
  for (int k = static_cast<int>(std::max<double>(orders, plain(x))) + miller_margin(plain(x)); k > 0; --k) {
    const S below = (2.0 * k + 1.0) * over * here - above;
    above = here;
    here = below;
    if (static_cast<std::size_t>(k) < r.psi.size()) r.psi[static_cast<std::size_t>(k)] = above;
    if (std::abs(plain(here)) > 1e200) {  // small x: the orders already found are that much smaller
      above = above * 1e-200, here = here * 1e-200;
      for (std::size_t n = static_cast<std::size_t>(k); n < r.psi.size(); ++n) r.psi[n] = r.psi[n] * 1e-200;
    }
  }
  r.psi[0] = here;
  const S scale = (psi0 * r.psi[0] + psi1 * r.psi[1]) * inverse(r.psi[0] * r.psi[0] + r.psi[1] * r.psi[1]);
  for (S& psi : r.psi) psi = psi * scale;
  r.eta[0] = -c;
  r.eta[1] = -(c * over) - s;
  for (std::size_t n = 1; n + 1 < size; ++n)
    r.eta[n + 1] = (2.0 * static_cast<double>(n) + 1.0) * over * r.eta[n] - r.eta[n - 1];
  return r;
}

int series_orders(double x) {
  // Outside, wave n is kept off the surface by a barrier: |a_n| is of the order of psi_n / eta_n(x), see miller_margin.
  // A high index inside does not change that: it makes resonances, but those of larger n are narrower than the rounding
  // of x. Wiscombe's x + 4 x^(1/3) + 2 (Appl. Opt. 19, 1505, 1980) stops at 1e-7.
  return static_cast<int>(x + 8 * std::cbrt(x)) + 6;
}

template <class S>
RadialSeries<S> radial_series(const RadialBall<S>& ball, int orders) {
  assert(!ball.layers.empty() && plain(ball.layers.front().radius_um) > 0);
  RadialSeries<S> series{ball.k0, ball.n_host, ball.layers.back().radius_um, {}, {}};
  const S x = ball.k0 * ball.n_host * series.radius_um;
  if (orders <= 0) orders = series_orders(plain(x));
  const RiccatiBessel<S> host = riccati_bessel(x, orders);
  const S over_x = inverse(x), over_host = inverse(ball.n_host);
  series.a.reserve(static_cast<std::size_t>(orders));
  series.b.reserve(static_cast<std::size_t>(orders));

  // Tangential fields at r, up to factors the modes of one n share: TM u and u' / n_o^2, TE u and u' (u' by k0 r).
  const auto at_surface = [&](int n, bool tm) {
    RadialPair<S> pair{S(0.0), S(0.0)};
    for (std::size_t i = 0; i < ball.layers.size(); ++i) {
      const RadialLayer<S>& layer = ball.layers[i];
      const S k = ball.k0 * layer.n_o, z = k * layer.radius_um;
      S lambda(n * (n + 1.0));
      if (tm) lambda = lambda * square(layer.n_o * inverse(layer.n_e));
      if (i == 0) {
        pair = regular_pair(tm ? sqrt(lambda + 0.25) - 0.5 : S(static_cast<double>(n)), z);
      } else {
        const S step = ball.layers[i - 1].n_o * inverse(layer.n_o);
        pair.slope = tm ? pair.slope * inverse(step) : pair.slope * step;
        pair = carried(pair, lambda, k * ball.layers[i - 1].radius_um, z);
      }
    }
    const S& n_o = ball.layers.back().n_o;
    pair.slope = tm ? pair.slope * inverse(n_o) : pair.slope * n_o;
    return pair;
  };
  for (int n = 1; n <= orders; ++n) {
    const std::size_t i = static_cast<std::size_t>(n);
    const S psi = host.psi[i], eta = host.eta[i], turn = static_cast<double>(n) * over_x;
    const S psi_slope = host.psi[i - 1] - turn * psi, eta_slope = host.eta[i - 1] - turn * eta;
    const RadialPair<S> tm = at_surface(n, true), te = at_surface(n, false);
    series.a.push_back(coefficient(tm.u, tm.slope, psi, psi_slope * over_host, eta, eta_slope * over_host));
    series.b.push_back(coefficient(te.u, te.slope, psi, psi_slope * ball.n_host, eta, eta_slope * ball.n_host));
  }
  return series;
}

template <class S>
ScatteringAmplitudes<S> scattering_amplitudes(const RadialSeries<S>& series, const S& cos_theta) {
  ScatteringAmplitudes<S> sum;
  // The angular functions and their slopes are plain numbers; slope1, slope2 gather dS / d cos.
  constexpr bool kSlopes = ScalarTraits<S>::derivatives > 0;
  const double c = plain(cos_theta);
  Complex<double> slope1, slope2;
  double before = 0, pi = 1, before_slope = 0, pi_slope = 0;  // pi_(n-1), pi_n
  for (std::size_t i = 0; i < series.a.size(); ++i) {
    const double n = static_cast<double>(i) + 1, over = 1 / n, weight = over + 1 / (n + 1);  // (2n + 1) / (n (n + 1))
    const Complex<S>&a = series.a[i], &b = series.b[i];
    const double s = c * pi, t = s - before, f = weight * pi, g = weight * (n * t - before);  // weighted pi_n, tau_n
    sum.s1.re += f * a.re + g * b.re;
    sum.s1.im += f * a.im + g * b.im;
    sum.s2.re += g * a.re + f * b.re;
    sum.s2.im += g * a.im + f * b.im;
    if constexpr (kSlopes) {
      const double s_slope = pi + c * pi_slope, t_slope = s_slope - before_slope;
      const double f_slope = weight * pi_slope, g_slope = weight * (n * t_slope - before_slope);
      slope1 = slope1 + f_slope * value_of(a) + g_slope * value_of(b);
      slope2 = slope2 + g_slope * value_of(a) + f_slope * value_of(b);
      before_slope = pi_slope;
      pi_slope = s_slope + (1 + over) * t_slope;
    }
    before = pi;
    pi = s + (1 + over) * t;
  }
  if constexpr (kSlopes) {
    const S dc = change(cos_theta);
    sum.s1 = sum.s1 + Complex<S>(slope1.re * dc, slope1.im * dc);
    sum.s2 = sum.s2 + Complex<S>(slope2.re * dc, slope2.im * dc);
  }
  return sum;
}

template <class S>
S extinction_efficiency(const RadialSeries<S>& series) {
  S sum(0.0);
  for (std::size_t i = 0; i < series.a.size(); ++i)
    sum += (2.0 * static_cast<double>(i) + 3) * (series.a[i].re + series.b[i].re);
  return 2.0 * sum * inverse(square(series.k0 * series.n_host * series.radius_um));
}
template <class S>
S scattering_efficiency(const RadialSeries<S>& series) {
  S sum(0.0);
  for (std::size_t i = 0; i < series.a.size(); ++i)
    sum += (2.0 * static_cast<double>(i) + 3) * (norm(series.a[i]) + norm(series.b[i]));
  return 2.0 * sum * inverse(square(series.k0 * series.n_host * series.radius_um));
}

template <class S>
RadialImage<S>::RadialImage(const RadialSeries<S>& series, const S& objective_na, const S& defocus_um,
                            double rho_max_um, Pupil pupil, int nodes) {
  assert(plain(objective_na) > 0 && rho_max_um >= 0);
  const S k = series.k0 * series.n_host;
  // In theta nothing is singular, not even at 90 degrees: q dq / cos = k^2 sin d theta.
  const S edge = objective_na * inverse(series.n_host);
  const double edge_sine = std::min(plain(edge), 1.0), theta = std::asin(edge_sine);
  const S theta_max = edge_sine < 1 ? theta + change(edge) / std::cos(theta) : S(theta);
  if (nodes <= 0) {
    // The integrand swings no faster than its highest order, J(k rho sin theta) and the defocus together. A rule for a
    // wave of `swing` radians over half the range is exact from swing / 2 nodes on, up to a tail like that of a Bessel
    // function.
    const double swing =
        0.5 * theta * (series.orders() + plain(k) * (rho_max_um + std::abs(plain(defocus_um)) * edge_sine));
    nodes = static_cast<int>(0.5 * swing + 5 * std::cbrt(swing)) + 10;
  }
  std::vector<double> x, w;
  legendre_nodes(nodes, x, w);
  nodes_.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    S s, c;
    sin_cos(theta_max * (0.5 * (1 + x[i])), s, c);
    const ScatteringAmplitudes<S> f = scattering_amplitudes(series, c);
    const Complex<S> s2 = pupil == Pupil::focal_plane ? c * f.s2 : f.s2;
    S weight = (0.25 * w[i]) * theta_max * s;  // 1/2 of the formula, 1/2 of the interval
    if (pupil == Pupil::aplanatic) weight = weight * sqrt(c);
    const Complex<S> wave = weight * exp(Complex<S>(S(0.0), k * (c - 1.0) * defocus_um));
    nodes_[i] = {k * s, -(wave * (s2 + f.s1)), wave * (s2 - f.s1)};
  }

  // J0 by Taylor polynomials, from its equation x J'' + J' + x J = 0; 1/8 from the middle the first term left out is
  // 1e-18, 1e-16 in the slope.
  bessel_.resize(static_cast<std::size_t>(plain(k) * edge_sine * rho_max_um * (1 + 1e-12) * kPerUnit) + 1);
  for (std::size_t i = 0; i < bessel_.size(); ++i) {
    const double at = (static_cast<double>(i) + 0.5) / kPerUnit;
    std::array<double, kTerms>& c = bessel_[i];
    c[0] = ::j0(at);
    c[1] = -::j1(at);
    for (std::size_t j = 2; j < kTerms; ++j) {
      const double n = static_cast<double>(j);
      c[j] = -(square(n - 1) * c[j - 1] + at * c[j - 2] + (j > 2 ? c[j - 3] : 0.0)) / (at * n * (n - 1));
    }
  }
}

template <class S>
RadialAmplitudes<S> RadialImage<S>::operator()(const S& rho_um) const {
  RadialAmplitudes<S> field;
  for (const Node& node : nodes_) {
    const S argument = node.q_per_um * rho_um;
    const double x = plain(argument);
    const std::size_t cell = static_cast<std::size_t>(x * kPerUnit);
    assert(x >= 0 && cell < bessel_.size());
    const double h = x - (static_cast<double>(cell) + 0.5) / kPerUnit;
    const std::array<double, kTerms>& c = bessel_[cell];
    double value = c[kTerms - 1], slope = 0;
    for (std::size_t j = kTerms - 1; j-- > 0;) {
      slope = slope * h + value;
      value = value * h + c[j];
    }
    // J2 = 2 J1 / x - J0 (J1 / x = 1/2 at zero), J2' = J1 - 2 J2 / x.
    const double over = x > 1e-9 ? 1 / x : 0, j2 = x > 1e-9 ? -2 * slope * over - value : 0;
    const S dx = change(argument);
    add(field.a0, value, slope, dx, node.weight0);
    add(field.a2, j2, -slope - 2 * j2 * over, dx, node.weight2);
  }
  return field;
}

Mat2<double> scattered_spectrum(const RadialSeries<double>& series, const std::array<double, 2>& kappa_in,
                                const std::array<double, 2>& kappa_out, double defocus_um, Pupil pupil) {
  const double n = series.n_host, k = series.k0 * n;
  const auto direction = [&](const std::array<double, 2>& kappa) {
    const double x = kappa[0] / n, y = kappa[1] / n;
    assert(x * x + y * y < 1);
    return Vec3<double>{x, y, std::sqrt(1 - x * x - y * y)};
  };
  const Vec3<double> in = direction(kappa_in), out = direction(kappa_out);

  // Across and in the plane of scattering. Straight on both amplitudes are equal and any plane will do.
  Vec3<double> across = cross(in, out);
  if (dot(across, across) < 1e-16)
    across = cross(in, std::abs(in.x) < 0.5 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0});
  across = normalized(across + -dot(across, in) * in);
  const Vec3<double> along_in = cross(across, in), along_out = cross(across, out);
  const ScatteringAmplitudes<double> f = scattering_amplitudes(series, dot(in, out));
  // The far field i / k (S2, S1) exp(i k r) / r belongs to the plane waves F = 2 pi i / (k cos) times that (stationary
  // phase).
  double scale = -2 * std::numbers::pi / (k * k * out.z);
  if (pupil == Pupil::aplanatic) scale *= std::sqrt(out.z / in.z);
  const Complex<double> wave = scale * exp(Complex<double>(0.0, k * (out.z - in.z) * defocus_um));

  // One column of the answer for each component of what comes in; turning is about z x direction.
  std::array<Complex<double>, 4> entry;
  for (std::size_t column = 0; column < 2; ++column) {
    Vec3<double> e{column == 0 ? 1.0 : 0.0, column == 0 ? 0.0 : 1.0, 0.0};
    const double tilt = dot(e, in);
    e.z = pupil == Pupil::focal_plane ? -tilt / in.z : -tilt;
    if (pupil != Pupil::focal_plane) e = e + (-tilt / (1 + in.z)) * Vec3<double>{in.x, in.y, 0};
    const Complex<double> parallel = dot(e, along_in) * (wave * f.s2), perpendicular = dot(e, across) * (wave * f.s1);
    const auto seen = [&](Vec3<double> v) {
      if (pupil != Pupil::focal_plane)
        v = v + (-((out.x * v.x + out.y * v.y) / (1 + out.z) + v.z)) * Vec3<double>{out.x, out.y, 0};
      return v;
    };
    const Vec3<double> p = seen(along_out), s = seen(across);
    entry[column] = p.x * parallel + s.x * perpendicular;
    entry[2 + column] = p.y * parallel + s.y * perpendicular;
  }
  return {entry[0], entry[1], entry[2], entry[3]};
}

#define BIREFIT_INSTANTIATE(S)                                                              \
  template RadialSeries<S> radial_series(const RadialBall<S>&, int);                        \
  template ScatteringAmplitudes<S> scattering_amplitudes(const RadialSeries<S>&, const S&); \
  template S extinction_efficiency(const RadialSeries<S>&);                                 \
  template S scattering_efficiency(const RadialSeries<S>&);                                 \
  template class RadialImage<S>;                                                            \
  template RadialPair<S> regular_pair(const S&, const S&);                                  \
  template RadialPair<S> carried(const RadialPair<S>&, const S&, const S&, const S&);       \
  template RiccatiBessel<S> riccati_bessel(const S&, int);
BIREFIT_INSTANTIATE(double)
using Single1 = Dual<double, 1>;
using Single2 = Dual<double, 2>;
using Single4 = Dual<double, 4>;
using Single8 = Dual<double, 8>;
BIREFIT_INSTANTIATE(Single1)
BIREFIT_INSTANTIATE(Single2)
BIREFIT_INSTANTIATE(Single4)
BIREFIT_INSTANTIATE(Single8)
#undef BIREFIT_INSTANTIATE

}  // namespace birefit
