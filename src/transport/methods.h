#pragma once
// The concrete methods. Only method.cc and the tests of a single method need to see them.

#include "transport/method.h"

namespace birefit {

/// Fields (E_x, E_y) of the ordinary and the extraordinary mode, scaled to unit flux; real in a lossless medium.
template <class S>
struct FluxModes {
  S ox, oy, ex, ey;
};
/// A lossless transfer without coupling: modes at both faces and their phases (rad).
template <class S>
struct ModalTransfer {
  FluxModes<S> first, last;
  S phase_o, phase_e;
};

/// One phase integral per mode of the local eigenframe, with the factors that keep its flux (or, e_only, its E):
/// 8 Gauss-Legendre nodes in every mesh step. What it leaves out is the coupling between the modes: none where the
/// axis stays in one plane through the ray, ~ coupling/(k0 (q_e - q_o)) where it turns slowly.
template <class S>
class Diagonal final : public TransportMethod<S> {
 public:
  /// transfer() in its parts; lossless, E and H continuous.
  static ModalTransfer<S> modal(const Column<S>&, const Ray<S>&, const Mesh&);
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
};

/// Exponential integrator of order 4: Omega = h/2 (A1 + A2) - sqrt(3)/12 h^2 [A1, A2] at the two Gauss nodes of a step
/// (A1 first along the ray), exact 2 x 2 exponential. Iserles & Norsett, Phil. Trans. R. Soc. A 357 (1999).
template <class S>
class Magnus4 final : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
};

/// A stack of homogeneous layers, one a mesh step, with the medium of its middle: order 2.
template <class S>
class LayersMidpoint final : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
};

}  // namespace birefit
