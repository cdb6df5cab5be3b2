#pragma once
// One direction of light through a plane-parallel sample.

#include "instrument/beam.h"
#include "samples/image.h"
#include "transport/method.h"

namespace birefit {

template <class S>
struct PlanarOptics {
  std::unique_ptr<CachedColumn<S>> column;
  S k0, n_host;
  Continuity continuity = Continuity::e_and_h;
};

/// `continuity`: for who sends light through it.
template <class S>
PlanarOptics<S> planar_optics(const Scene& scene, const Values<S>& value, Continuity continuity = Continuity::e_and_h);

/// Jones matrix in the lab's x, y after unrolling s and p by the azimuth, faces included; (tx, ty) = tan(incidence in
/// the host) times the unit vector of the azimuth.
template <class S>
Mat2<S> planar_jones(const PlanarOptics<S>& optics, const TransportMethod<S>& method, const Mesh& mesh, const S& tx,
                     const S& ty);

/// The same between polarizers, for the methods `diagonal` and (with coupling) `modal`. Derivatives that the wavenumber
/// k0 (per um) and the polarizers know and neither medium nor direction cost least in R alone; `raise` brings those of
/// S to their places (optics.k0 is not read).
template <class S, class R>
FringePoint<R> planar_fringe(const PlanarOptics<S>& optics, bool coupling, const Mesh& mesh, const R& k0,
                             const Raise<S, R>& raise, const Line<R>& light, const S& tx, const S& ty);

template <class S>
std::unique_ptr<SampleImage<S>> make_planar_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
