#pragma once
// The concrete methods. Only method.cc and the tests of a single method need to see them.

#include "transport/method.h"
#include "transport/modes.h"

namespace birefit {

/// One phase integral per mode of the local eigenframe, with the factors that keep its flux (or, e_only, its E):
/// one Gauss-Legendre rule over each piece between breaks, of as many nodes as the mesh has steps there (where the
/// nodes of the mesh lie does not matter). What it leaves out is the coupling between the modes: none where the
/// axis stays in one plane through the ray, ~ coupling/(k0 (q_e - q_o)) where it turns slowly.
template <class S>
class Diagonal final : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
};

/// The local modes with their coupling: slow solutions of the equation for the ratio of their amplitudes, 8
/// Gauss-Legendre nodes in every mesh step (modal.cc has the equations). For axes that turn slowly against the phase,
/// thousands of radians in a few nodes; not where the axis comes near the wavevector or the medium jumps.
template <class S>
class Modal final : public TransportMethod<S> {
 public:
  static constexpr int kPasses = 5;
  explicit Modal(int passes = kPasses) : passes_(passes) {}
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;  ///< throws std::logic_error on jumps
  /// Has none (slabs and plates only): throws std::logic_error.
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;

 private:
  int passes_;
};
/// Modal::transfer() in its parts, `passes` times through the equation for the ratios; 0 = no coupling, one Gauss node
/// a step as in Diagonal. R has derivatives that the medium and the direction do not know, the wavenumber (per um)
/// does; `raise` brings those of S to their places. The ray's own wavenumber is not read.
template <class S, class R>
ModalTransfer<R> modal_transfer(const Column<S>&, const Ray<S>&, const R& k0_per_um, const Raise<S, R>& raise,
                                const Mesh&, int passes = Modal<S>::kPasses);
template <class S>
ModalTransfer<S> modal_transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh,
                                int passes = Modal<S>::kPasses) {
  return modal_transfer(column, ray, ray.k0_per_um, Raise<S, S>(), mesh, passes);
}
/// The same of Diagonal::transfer().
template <class S, class R>
ModalTransfer<R> diagonal_transfer(const Column<S>&, const Ray<S>&, const R& k0_per_um, const Raise<S, R>& raise,
                                   const Mesh&);
template <class S>
ModalTransfer<S> diagonal_transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) {
  return diagonal_transfer(column, ray, ray.k0_per_um, Raise<S, S>(), mesh);
}
template <class S>
Mat2<S> together(const ModalTransfer<S>&);

/// Exponential integrator of order 4: Omega = h/2 (A1 + A2) - sqrt(3)/12 h^2 [A1, A2] at the two Gauss nodes of a step
/// (A1 first along the ray), exact 2 x 2 exponential. Iserles & Norsett, Phil. Trans. R. Soc. A 357 (1999).
template <class S>
class Magnus4 final : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
};

/// Exponential integrator of order 6, three Gauss nodes a step. Blanes, Casas, Oteo & Ros, Phys. Rep. 470, 151 (2009).
template <class S>
class Magnus6 final : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
};

/// A stack of homogeneous layers, one a mesh step, each with the medium at one place of it (0 its upper face, 1/2 its
/// middle).
template <class S>
class Layers : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override { return info_; }
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;

 protected:
  Layers(const MethodInfo& info, double place) : info_(info), place_(place) {}

 private:
  const MethodInfo& info_;
  double place_;
};
/// Order 2.
template <class S>
class LayersMidpoint final : public Layers<S> {
 public:
  LayersMidpoint();
};
/// Order 1: the source paper's brute force.
template <class S>
class LayersEdge final : public Layers<S> {
 public:
  LayersEdge();
};

/// The whole of Maxwell's equations in a stratified medium, all reflections included, the faces too. Steps of the 4 x 4
/// transfer (Berreman, J. Opt. Soc. Am. 62, 502 (1972)) by Magnus of order 4, turned into scattering matrices of
/// the host's waves and joined by Redheffer's star product: stable however thick or absorbing the stack is.
template <class S>
class Berreman final : public TransportMethod<S> {
 public:
  const MethodInfo& info() const override;
  /// Has no one-way transfer: these throw std::logic_error.
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Mat2<S> transmission(const Column<S>&, const Ray<S>&, const Mesh&, const S& host_index) const override;
  /// Tangential E of the reflected wave over that of the incident one, in the same axes.
  Mat2<S> reflection(const Column<S>&, const Ray<S>&, const Mesh&, const S& host_index) const;
};

}  // namespace birefit
