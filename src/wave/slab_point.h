#pragma once
// What a thin slab of an inhomogeneous medium does to a field that goes through it, at one point.

#include <array>
#include <cmath>

#include "core/scalar.h"
#include "medium/column.h"
#include "transport/method.h"

namespace birefit {

// One slab of thickness h takes the field through
//   a <- exp(i k0 V'_2) D^(1/2) S D^(1/2) exp(i k0 V'_1) a,
// D free propagation in n_ref, S the screen: the ordered product over thin layers of exp(i k0 dz (N - n_ref)), N the
// exact 2 x 2 operator of normal incidence (N_e along the transverse director t, N_o along s), and V'_1, V'_2 what
// transverse wavevectors kappa = k / k0 add to the second order, summed over the layers of the first and of the second
// half. The second half of one slab and the first of the next are taken together: second order in h for the price of
// the first.
//   V' a = -1/2 [kappa (v . a) + v (kappa . a)] - 1/2 kappa (sd (kappa . a)) - 1/2 kappa' (sc (kappa' . a)) + kappa_i
//   (D_ij (kappa_j a)).
// It follows from the Riccati equation of the one-way Maxwell system, h = Y e; the order of wavevector and coefficient
// counts. v walks extraordinary light off sideways; sd, sc and D are what diffraction in the medium has beyond that in
// n_ref.

/// V' of some thickness at one point, thickness and k0 taken in: h v, (h / k0) of the others.
template <class S>
struct ObliquePoint {
  S v[2];
  S sd, sc;
  S d[3][3];  ///< D_ij^ab: ij, ab = xx, xy, yy
};
inline constexpr int kWalk = 0, kSd = 2, kSc = 3, kD = 4, kObliques = 13;
/// Of a slab at one point.
template <class S>
struct SlabPoint {
  Complex<S> screen[2][2];
  ObliquePoint<S> half[2];
};
inline constexpr int kScreens = 8;

template <class S>
void clear(SlabPoint<S>& p) {
  p.screen[0][0] = p.screen[1][1] = Complex<S>(S(1.0));
  p.screen[0][1] = p.screen[1][0] = Complex<S>();
  for (ObliquePoint<S>& o : p.half) {
    o.v[0] = o.v[1] = o.sd = o.sc = S(0.0);
    for (auto& row : o.d)
      for (S& x : row) x = S(0.0);
  }
}

/// N = n_o + g n_t n_t^T at one place.
template <class S>
struct Flat {
  S sum;  ///< n_o + N_e
  S g, x, y;
};

/// What one layer, of this thickness, adds to V'.
template <class S>
Flat<S> add_layer(ObliquePoint<S>& p, const OpticalPoint<S>& medium, const S& k0, double n_ref, double thickness) {
  const S eo = medium.ordinary, de = medium.extraordinary - eo;
  const Vec3<S>& n = medium.axis;
  const S t2 = n.x * n.x + n.y * n.y, eta = inverse(S(eo + de * n.z * n.z));
  const S no = root(eo), ne = root(eo * medium.extraordinary * eta), sum = no + ne, over = inverse(sum);
  const S g = eo * de * eta * over;  // (ne - no) / t2, finite for an axis along z
  const S walk = thickness * de * n.z * eta;
  p.v[0] = p.v[0] + walk * n.x;
  p.v[1] = p.v[1] + walk * n.y;
  const S scale = inverse(k0) * thickness, mean = 0.5 * sum, over_mean = 2.0 * over;
  p.sd = p.sd + scale * (eta * mean - 1.0 / n_ref);
  p.sc = p.sc + scale * (over_mean - 1.0 / n_ref);
  const S w = de * n.z * eta, w2 = w * w * t2, c = no * over, w2c = w2 * c, w2c2 = w2c * c, inverse_ne = inverse(ne),
          inverse_no = inverse(no);
  // Per kt^2 on (tt, ss), per ks^2, and per kt ks on ts: S less the parts of sd and sc.
  const S tt_tt = 0.25 * eta * (no - ne), tt_ss = 0.5 * (over_mean - inverse_no);
  const S ss_tt = 0.5 * (over_mean - inverse_ne) + (w2c2 - 2.0 * w2c) * 0.5 * inverse_ne,
          ss_ss = 0.25 * eta * (ne - no) + 0.5 * w2c2 * inverse_no;
  const S ts_ts = (1.0 + eta * ne * no + w2c) * over - eta * root(ne * no) + 0.5 * (eta * mean - over_mean);
  const S inverse_t2 = inverse(S(t2 + 1e-24));
  const S t[3] = {n.x * n.x * inverse_t2, n.x * n.y * inverse_t2, n.y * n.y * inverse_t2};  // t t^T
  const S o[3] = {t[2], S(0.0) - t[1], t[0]};                                               // s s^T
  const S m[3] = {S(0.0) - 2.0 * t[1], t[0] - t[2], 2.0 * t[1]};                            // t s^T + s t^T
  for (int ij = 0; ij < 3; ++ij) {
    const S on_t = scale * (tt_tt * t[ij] + ss_tt * o[ij]), on_s = scale * (tt_ss * t[ij] + ss_ss * o[ij]),
            mixed = 0.5 * scale * ts_ts * m[ij];
    for (int ab = 0; ab < 3; ++ab) p.d[ij][ab] = p.d[ij][ab] + on_t * t[ab] + on_s * o[ab] + mixed * m[ab];
  }
  return {sum, g, n.x, n.y};
}

/// The screen of thickness h, N known at its two Gauss points: the fourth order of Magnus' series, by Gauss' rule and
/// the commutator,
///   exp(i k0 h ((N_1 + N_2) / 2 - n_ref) + sqrt(3)/12 (k0 h)^2 [N_1, N_2]),
/// and where N turns by dphi the field turns back by dphi (N_e - N_o)^2 / (2 (N_e + N_o)^2): what dY/dz leaves of the
/// Riccati equation, to second order in d/dz / k0, where N is constant in front and behind. A helix's exact modes have
/// it.
template <class S>
void pass_layers(SlabPoint<S>& slab, const Flat<S>& one, const Flat<S>& two, const S& k0, double n_ref, double h) {
  const S phase = k0 * h, mean = 0.25 * (one.sum + two.sum), over = inverse(mean), quarter = 0.25 * phase;
  // N_1 + N_2 in parts: 1, i (x x - y y), i (x y + y x); and a rotation.
  const S p3 = quarter * (one.g * (one.x * one.x - one.y * one.y) + two.g * (two.x * two.x - two.y * two.y));
  const S p1 = 2.0 * quarter * (one.g * one.x * one.y + two.g * two.x * two.y);
  const S turned =
      std::numbers::sqrt3 * one.g * two.g * (one.x * two.x + one.y * two.y) * (one.x * two.y - one.y * two.x);
  const S p2 = turned * ((-1.0 / 12) * phase * phase - 0.125 * over * over);
  const CosSinc<S> turn = cos_sinc_sq(S(p3 * p3 + p1 * p1 + p2 * p2));
  S sm, cm;
  sin_cos(phase * (mean - n_ref), sm, cm);
  const Complex<S> whole(cm, sm);
  const Complex<S> a = whole * Complex<S>(turn.cos_sq, turn.sinc_sq * p3),
                   d = whole * Complex<S>(turn.cos_sq, S(0.0) - turn.sinc_sq * p3);
  const S rotation = turn.sinc_sq * p2, across = turn.sinc_sq * p1;
  const Complex<S> b = whole * Complex<S>(S(0.0) - rotation, across), c = whole * Complex<S>(rotation, across);
  for (int i = 0; i < 2; ++i) {
    const Complex<S> top = slab.screen[0][i], bottom = slab.screen[1][i];
    slab.screen[0][i] = a * top + b * bottom;
    slab.screen[1][i] = c * top + d * bottom;
  }
}

/// The medium in a slab is asked for at `layers` depths, two by two the Gauss points of equal parts.
double layer_depth(int layer, int layers) {
  return (layer / 2 + 0.5 + (layer % 2 == 0 ? -0.5 : 0.5) / std::numbers::sqrt3) * 2 / layers;
}
template <class S, class F>
SlabPoint<S> slab_point(int layers, double slab_um, const S& k0, double n_ref, const F& medium_at) {
  SlabPoint<S> p;
  clear(p);
  Flat<S> before;
  for (int l = 0; l < layers; ++l) {
    const Flat<S> here = add_layer(p.half[2 * l < layers ? 0 : 1], medium_at(l), k0, n_ref, slab_um / layers);
    if (l % 2 == 1) pass_layers(p, before, here, k0, n_ref, 2 * slab_um / layers);
    before = here;
  }
  return p;
}

}  // namespace birefit
