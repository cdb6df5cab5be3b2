#pragma once
// Every kind of sample by what it can do. A new one is a folder here, its struct in birefit/sample.h and a line in
// kinds.def.

#include "samples/jones_table.h"
#include "samples/pilots.h"
#include "samples/planning.h"

namespace birefit {

struct SampleKind {
  const char* name;
  bool (*is)(const Scene&, const Observable&);
  /// By rays; waves are planned by samples/waves for all kinds that have them.
  RenderPlan (*plan)(const Planning&);
  /// The rays on which transport methods are judged; null: closed forms, nothing to choose.
  Pilots (*pilots)(const Scene&, const Demand&, const Values<double>&);
  /// Retardances at points fixed relative to the sample (rad): how fast fringes go by a parameter.
  std::vector<double> (*phases_rad)(const Scene&, const Values<double>&);
  /// Adds to a plan what holds of the sample by whatever physics; may be null.
  void (*note)(const Scene&, const Values<double>&, RenderPlan&);
  /// Null: one closed formula a pixel, no table of matrices.
  void (*jones)(const Scene&, const RenderPlan&, const Values<double>&, JonesTable&);
  /// Whether pictures may have a symmetry; null: none has.
  bool (*symmetric)(const Scene&);
  bool passes_axis;  ///< rays run along the optic axis somewhere: no transport in the modes' slow solutions
};
/// The first kind of kinds.def that it is.
const SampleKind& kind_of(const Scene& scene, const Observable& observable = {});

/// What is seen of the scene in the light of one direction, `plan` of the same scene; by a scalar for tables only where
/// the plan has tables. The maker must outlive the image.
template <class S>
std::unique_ptr<SampleImage<S>> make_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
