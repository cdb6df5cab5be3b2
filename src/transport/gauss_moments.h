#pragma once
// The integrals of the closed form of Steinberg TOG 2020 (eqs. 34-36), evaluated stably.

#include "core/scalar.h"

namespace birefit {

inline constexpr int kMaxMoment = 11;

/// I_m(x1, x2) = int_0^1 t^m exp(-i (x1 t + x2 t^2)) dt for m = 0 .. n, any real x1, x2; 0 <= n <= kMaxMoment.
/// Errors below 1e-12 of |I_m| wherever |I_m| is not itself a cancellation. moments has n + 1 places.
///
/// The paper's own form (powers of alpha, beta, binomials; error functions) loses eps (|x1|/2|x2|)^n and divides by
/// zero at x2 = 0, which every stack of layers meets. Three ways instead, each where it is exact to rounding:
/// Gauss-Legendre while the phase is small; the Faddeeva function and upward recurrence where the quadratic phase is
/// large; the same recurrence as a diagonally dominant system where the linear phase dominates.
void gauss_moments(int n, double x1, double x2, Complex<double>* moments);

}  // namespace birefit
