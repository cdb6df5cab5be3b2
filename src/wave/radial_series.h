#pragma once
// The exact image of a ball or of concentric shells whose optic axis is radial (permittivity n_e^2 along r, n_o^2
// across) in an isotropic host: the Mie series, its angular spectrum and the focal plane of an objective. Maxwell's
// equations without approximation, so the anchor of every approximate wave model.
//
// Sources: C. F. Bohren & D. R. Huffman, Absorption and Scattering of Light by Small Particles (1983), chapter 4
// (series, angular functions, efficiencies); J. Roth & M. J. Dignam, J. Opt. Soc. Am. 63, 308 (1973) for the radial
// axis, see also C.-W. Qiu et al., IEEE Trans. Antennas Propag. 55, 3515 (2007). Conventions: docs/conventions.md, C1,
// C7, C9; the centre of the ball is the origin, the incident wave runs towards +z and has amplitude 1 and phase 0 in
// the middle of the focal plane.
//
// All indices are real: absorption is not supported. Scalars S: double and Dual<double, N>, N = 1, 2, 4, 8 (a line at
// the end of radial_series.cc adds more); with duals every result carries its derivatives by whatever the inputs depend
// on.

#include <array>
#include <vector>

#include "core/jones.h"
#include "core/scalar.h"

namespace birefit {

/// One layer, out to radius_um > 0. An isotropic one has n_o = n_e. Indices positive.
template <class S>
struct RadialLayer {
  S radius_um, n_o, n_e;
};
/// Layers from the inside out, at least one, radii not decreasing (a layer without thickness does nothing).
/// Sizes k0 n R to about 1000; accuracy about 1e-12 (coefficients absolutely, an interior resonance excepted).
template <class S>
struct RadialBall {
  std::vector<RadialLayer<S>> layers;
  S n_host;
  S k0;  ///< 2 pi / vacuum wavelength, 1/um
};

/// Scattering coefficients: a[n - 1] and b[n - 1] are Bohren & Huffman's a_n (TM) and b_n (TE), n = 1 .. orders().
template <class S>
struct RadialSeries {
  S k0, n_host, radius_um;  ///< of the outermost layer
  std::vector<Complex<S>> a, b;
  int orders() const { return static_cast<int>(a.size()); }
};

/// Orders that matter for a ball of size x = k0 n_host R: those left out are below 1e-16. The sum ends at `orders` if
/// positive.
int series_orders(double x);
template <class S>
RadialSeries<S> radial_series(const RadialBall<S>&, int orders = 0);

/// Amplitude functions of a far field (Bohren & Huffman 4.74), S1 across and S2 in the plane of scattering, -1 <= cos
/// <= 1.
template <class S>
struct ScatteringAmplitudes {
  Complex<S> s1, s2;
};
template <class S>
ScatteringAmplitudes<S> scattering_amplitudes(const RadialSeries<S>&, const S& cos_theta);

/// Cross-sections over pi R^2 (Bohren & Huffman 4.61, 4.62). Without absorption they are equal.
template <class S>
S extinction_efficiency(const RadialSeries<S>&);
template <class S>
S scattering_efficiency(const RadialSeries<S>&);

/// What the objective makes of the plane waves it accepts.
enum class Pupil {
  focal_plane,  ///< the transverse field in the host's focal plane (C23): of a p wave only the part across z
  unrolled,     ///< p and s turned into the plane, amplitudes kept
  aplanatic     ///< unrolled and times sqrt(cos theta), which keeps the flux (C24)
};

/// Field at image radius rho and azimuth phi for light polarized at azimuth P, unit incident amplitude:
///   E_along = 1 + A0 + A2 cos 2(phi - P),   E_across = A2 sin 2(phi - P)
/// along P and 90 degrees counter-clockwise of it (C11).
template <class S>
struct RadialAmplitudes {
  Complex<S> a0, a2;
};

/// The image as a function of its radius. Building it costs the angular sums and a table of Bessel functions, each
/// radius then two sums over the nodes of one Gauss-Legendre rule in theta, long enough for 1e-13 up to the largest
/// radius.
template <class S>
class RadialImage {
 public:
  /// objective_na > 0; from n_host on the whole forward half space is accepted. The plane in focus lies defocus_um
  /// beyond the centre along the light. 0 <= rho_max_um bounds what may be asked later. `nodes` overrides the length of
  /// the rule.
  RadialImage(const RadialSeries<S>& series, const S& objective_na, const S& defocus_um, double rho_max_um,
              Pupil pupil = Pupil::focal_plane, int nodes = 0);
  /// 0 <= rho_um <= rho_max_um.
  RadialAmplitudes<S> operator()(const S& rho_um) const;
  int nodes() const { return static_cast<int>(nodes_.size()); }

 private:
  // J0 about (i + 1/2) / kPerUnit in powers of the distance: both functions and their slopes from one short polynomial.
  static constexpr int kPerUnit = 4, kTerms = 11;
  struct Node {
    S q_per_um;
    Complex<S> weight0, weight2;
  };
  std::vector<Node> nodes_;
  std::vector<std::array<double, kTerms>> bessel_;
};

/// Angular spectrum of the scattered field for light from any forward direction:
///   e(x, y) = e_in exp(i k0 kappa_in . x) + integral d^2k / (2 pi)^2  F(k; kappa_in) e_in exp(i k . x),  k = k0
///   kappa_out (1/um),
/// in the focal plane, for each pair (x, y) of components that `pupil` makes of a plane wave, the incident one
/// included: for focal_plane they are the transverse field, otherwise the field turned from the wave's direction to z
/// the short way (p to the azimuth of kappa, s across), for aplanatic times sqrt(cos theta). F is in um^2, rows:
/// scattered x, y; columns: incident x, y. kappa in units of k0, |kappa| < n_host: forward travelling waves only.
Mat2<double> scattered_spectrum(const RadialSeries<double>&, const std::array<double, 2>& kappa_in,
                                const std::array<double, 2>& kappa_out, double defocus_um,
                                Pupil pupil = Pupil::focal_plane);

// ---- radial functions, also for tests ------------------------------------------------------------------------------

/// A solution u(z) of u'' + (1 - lambda / z^2) u = 0 and du/dz at one z, both times the same constant, which nobody
/// needs.
template <class S>
struct RadialPair {
  S u, slope;
};
/// Riccati-Bessel psi_nu(z) = sqrt(pi z / 2) J_(nu + 1/2)(z), lambda = nu (nu + 1), nu > 0 real, z > 0.
template <class S>
RadialPair<S> regular_pair(const S& nu, const S& z);
/// The same solution at z_to >= z_from.
template <class S>
RadialPair<S> carried(const RadialPair<S>&, const S& lambda, const S& z_from, const S& z_to);
/// psi_n(x) = x j_n(x) and eta_n(x) = x y_n(x), n = 0 .. orders, so that xi_n = psi_n + i eta_n. x > 0; orders about
/// series_orders(x).
template <class S>
struct RiccatiBessel {
  std::vector<S> psi, eta;
};
template <class S>
RiccatiBessel<S> riccati_bessel(const S& x, int orders);

}  // namespace birefit
