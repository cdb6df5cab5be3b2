#pragma once
// The ordinary and the extraordinary wave of a uniaxial medium, and transport written in them. Singular where the axis
// is parallel to the wavevector: the methods that use it say so.

#include <algorithm>

#include "medium/column.h"
#include "transport/method.h"

namespace birefit {

/// Normal components (units of k0) and fields of both waves, Steinberg TOG 2020 eqs. 70, 72; fields = tangential parts
/// as columns (ordinary, extraordinary), z their third components.
template <class T>
struct Modes {
  Complex<T> q_o, q_e;
  Mat2<T> fields;
  Complex<T> z_o, z_e;
};
template <class T>
Modes<T> modes(const OpticalPoint<T>& p, const T& kx, const T& ky) {
  using C = Complex<T>;
  const C eo{p.ordinary, p.ordinary_im}, ee{p.extraordinary, p.extraordinary_im};
  const C de = ee - eo;
  const T ak = p.axis.x * kx + p.axis.y * ky, kk = kx * kx + ky * ky;
  const C A = eo + (p.axis.z * p.axis.z) * de, B = (p.axis.z * ak) * de;
  const C Cc = kk * eo + (ak * ak) * de - eo * ee;
  Modes<T> m;
  m.q_o = sqrt(eo - C(kk));
  m.q_e = (sqrt(B * B - A * Cc) - B) / A;
  const C aw = C(ak) + p.axis.z * m.q_e;
  const C ux = p.axis.y * m.q_o - C(p.axis.z * ky), uy = C(p.axis.z * kx) - p.axis.x * m.q_o;
  m.fields = {ux, p.axis.x * eo - kx * aw, uy, p.axis.y * eo - ky * aw};
  m.z_o = C(p.axis.x * ky - p.axis.y * kx);
  m.z_e = p.axis.z * eo - m.q_e * aw;
  return m;
}
/// The same with E.E = 1 (no conjugation: |E| = 1 in lossless media, analytic in absorbing ones).
template <class T>
Modes<T> unit_modes(const OpticalPoint<T>& p, const T& kx, const T& ky) {
  Modes<T> m = modes(p, kx, ky);
  const auto scale = [](Complex<T>& x, Complex<T>& y, Complex<T>& z) {
    const Complex<T> f = Complex<T>(T(1.0)) / sqrt(x * x + y * y + z * z);
    x = f * x, y = f * y, z = f * z;
  };
  scale(m.fields.a, m.fields.c, m.z_o);
  scale(m.fields.b, m.fields.d, m.z_e);
  return m;
}

/// Transport in the modes: last diag(e^{log_o}, e^{log_e}) first^-1, columns of `first` and `last` the E_t of the two
/// waves at the faces.
template <class S>
struct ModalTransfer {
  Mat2<S> first, last;
  Complex<S> log_o, log_e;
};

/// Where the axis passes the wavevector the ordinary field a x w turns over, and whoever follows the modes by steps
/// that miss the place ends with the wrong sign of one of them. True when the field turns by more than 60 degrees
/// between two of `places` + 1 equally spaced u; medium(u) gives the OpticalPoint<double>.
template <class Medium>
bool modes_turn_over(const Medium& medium, const Ray<double>& ray, double from, double to, int places) {
  Vec3<double> last{0, 0, 0};
  for (int i = 0; i <= places; ++i) {
    const double inside = 1e-12 + (1 - 2e-12) * i / places;
    const OpticalPoint<double> p = medium(from + (to - from) * inside);
    const double q = std::sqrt(std::max(0.0, p.ordinary - ray.kx * ray.kx - ray.ky * ray.ky));
    const Vec3<double> now{p.axis.y * q - p.axis.z * ray.ky, p.axis.z * ray.kx - p.axis.x * q,
                           p.axis.x * ray.ky - p.axis.y * ray.kx};
    if (i > 0 && dot(now, last) <= 0.5 * std::sqrt(dot(now, now) * dot(last, last))) return true;
    last = now;
  }
  return false;
}

/// d psi/dz = [[a + b3, b1], [b2, a - b3]] psi of the mode amplitudes psi = (ordinary, extraordinary), per um; eqs. 20,
/// 23, 82: b1 couples the extraordinary wave into the ordinary one, b2 the other way.
template <class T>
struct ModalGenerator {
  Complex<T> a, b1, b2, b3;
};

// Two scalars know a derivative in depth: Slope<S> at a point, Series<double> as a whole.
template <class S>
Mat2<S> value_of(const Mat2<Slope<S>>& m) {
  return part(m, false);
}
template <class S>
Mat2<S> derivative_of(const Mat2<Slope<S>>& m) {
  return part(m, true);
}
template <class S>
OpticalPoint<S> value_of(const OpticalPoint<Slope<S>>& p) {
  return without_slope(p);
}
template <class S>
Complex<S> value_of(const Complex<Slope<S>>& z) {
  return {z.re.value, z.im.value};
}
inline const Mat2<Series<double>>& value_of(const Mat2<Series<double>>& m) { return m; }
inline Mat2<Series<double>> derivative_of(const Mat2<Series<double>>& m) {
  const auto of = [](const Complex<Series<double>>& z) {
    return Complex<Series<double>>{derivative(z.re), derivative(z.im)};
  };
  return {of(m.a), of(m.b), of(m.c), of(m.d)};
}
inline const OpticalPoint<Series<double>>& value_of(const OpticalPoint<Series<double>>& p) { return p; }
inline const Complex<Series<double>>& value_of(const Complex<Series<double>>& z) { return z; }

/// What makes a ModalGenerator but for the wavenumber, which nothing else here knows.
template <class T>
struct ModalRates {
  Complex<T> q_o, q_e;
  Mat2<T> turning;  ///< of the modes' fields, in themselves
};
/// Of modes scaled to E.E = 1. D = Slope<S> (result in S) or Series<double>; derivatives of p are by depth in um, or by
/// any coordinate; the series of the result are exact up to one order less than
/// p's. E and H continuous adds (Y - Y-)^-1 dY/dz of one_way.h to the coupling, which the source paper has not.
template <class D, class S>
auto modal_rates(const OpticalPoint<D>& p, const Ray<S>& ray) {
  const Modes<D> m = unit_modes(p, D(ray.kx), D(ray.ky));
  const auto fields = value_of(m.fields);
  auto change = derivative_of(m.fields);
  using C = std::remove_cvref_t<decltype(fields.a)>;
  using T = typename NumberTraits<C>::Real;
  if (ray.continuity == Continuity::e_and_h) {
    const Mat2<D> admittance = one_way(p, D(ray.kx), D(ray.ky)).admittance;
    const OpticalPoint<T> q = value_of(p);
    const Mat2<T> backward = one_way(q, T(ray.kx), T(ray.ky), -1.0).admittance;
    change = change + inverse(value_of(admittance) - backward) * derivative_of(admittance) * fields;
  }
  return ModalRates<T>{value_of(m.q_o), value_of(m.q_e), inverse(fields) * change};
}
/// k: the wavenumber per unit of the coordinate by which the rates are.
template <class T>
ModalGenerator<T> modal_generator(const ModalRates<T>& rates, const T& k) {
  const Complex<T> ik(T(0.0), k), o = ik * rates.q_o - rates.turning.a, e = ik * rates.q_e - rates.turning.d;
  return {T(0.5) * (o + e), -rates.turning.b, -rates.turning.c, T(0.5) * (o - e)};
}
/// Depth grows by `um_per_unit` in the coordinate that p's derivatives are by.
template <class D, class S>
auto modal_generator(const OpticalPoint<D>& p, const Ray<S>& ray, const S& um_per_unit = S(1.0)) {
  const auto rates = modal_rates(p, ray);
  using T = std::remove_cvref_t<decltype(rates.q_o.re)>;
  return modal_generator(rates, T(ray.k0_per_um * um_per_unit));
}

/// p with its derivatives by u turned into derivatives by depth.
inline OpticalPoint<Slope<double>> by_depth(OpticalPoint<Slope<double>> p) {
  const double f = 1 / p.depth_slope_um.value;
  for (Slope<double>* x : {&p.axis.x, &p.axis.y, &p.axis.z, &p.ordinary, &p.extraordinary, &p.ordinary_im,
                           &p.extraordinary_im, &p.depth_slope_um})
    x->d[0] *= f;
  return p;
}
/// p as series in depth instead of u: du/dz = 1/slope(u) solved for u(z), one coefficient a pass, and put in.
inline OpticalPoint<Series<double>> by_depth(OpticalPoint<Series<double>> p) {
  const Series<double> u_per_um = inverse(p.depth_slope_um);
  Series<double> u = Series<double>::of_order(u_per_um.order);
  const bool constant =
      std::all_of(p.depth_slope_um.c.begin() + 1, p.depth_slope_um.c.end(), [](double c) { return c == 0; });
  const int passes = constant ? 1 : u.order;
  for (int k = 0; k < passes; ++k) u = integral(u_per_um(u));
  for (Series<double>* x : {&p.axis.x, &p.axis.y, &p.axis.z, &p.ordinary, &p.extraordinary, &p.ordinary_im,
                            &p.extraordinary_im, &p.depth_slope_um})
    *x = (*x)(u);
  return p;
}

}  // namespace birefit
