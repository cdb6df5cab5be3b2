#pragma once
// A sampled field seen along its z: one straight ray a point of the image.

#include <utility>
#include <vector>

#include "birefit/volume.h"
#include "samples/jones_table.h"
#include "samples/pilots.h"
#include "samples/planning.h"
#include "transport/method.h"

namespace birefit {

struct SampleKind;   // samples/kind.h
struct SampleWaves;  // samples/waves/object.h

template <class S>
struct VolumeOptics {
  std::shared_ptr<const VolumeGrid> grid;
  std::vector<double> breaks;  ///< inner layers, in u
  S center_x_px, center_y_px;
  S nodes_per_px_x, nodes_per_px_y;
  S cos_turn, sin_turn;  ///< of the sample in the image
  S n_o, birefringence, k0, depth_um;
  Continuity continuity = Continuity::e_and_h;

  /// `of_light`: for who sends light through it.
  VolumeOptics(const Scene& scene, const Values<S>& value, Continuity of_light = Continuity::e_and_h);
  /// Place in the box, in nodes from the first.
  void place(const S& column, const S& row, S& x, S& y) const {
    const S east = column - center_x_px, north = center_y_px - row;
    x = (cos_turn * east + sin_turn * north) * nodes_per_px_x + 0.5 * (grid->nx - 1);
    y = (cos_turn * north - sin_turn * east) * nodes_per_px_y + 0.5 * (grid->ny - 1);
  }
};

/// Retarder of the ray at (x, y), in nodes from the first, inside the box; in the image's x, y.
template <class S>
Su2<S> volume_retarder(const VolumeOptics<S>&, const S& x, const S& y, const TransportMethod<S>&, const Mesh&);

/// Jones matrix of the ray at a point of the image in pixels; the identity beside the box.
Mat2<double> volume_jones(const VolumeOptics<double>&, double column, double row, const TransportMethod<double>&,
                          const Mesh&);

/// Places of rays spread evenly over the box, in nodes.
std::pair<double, double> volume_place(const VolumeGrid&, int ray);
/// Retardance phases (rad) of the first so many of them, moved by (dx, dy) nodes, as if the axis did not turn along
/// them.
std::vector<double> volume_phases(const VolumeOptics<double>&, int rays, double dx = 0, double dy = 0);

/// Points of the medium that one ray takes.
int volume_samples(const VolumeOptics<double>&, const TransportMethod<double>&, const Mesh&);

template <class S>
std::unique_ptr<SampleImage<S>> make_volume_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

/// How waves go through it.
extern const SampleWaves kVolumeWaves;
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kVolume;

}  // namespace birefit
