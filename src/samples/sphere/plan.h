#pragma once
// Plans of droplets and shells by straight rays and by curved ones.

#include "samples/jones_table.h"
#include "samples/pilots.h"
#include "samples/planning.h"

namespace birefit {

struct SampleKind;   // samples/kind.h
struct SampleWaves;  // samples/waves/object.h

RenderPlan plan_sphere(const Planning&);
/// Retardance phases at points fixed relative to the sphere, as if modes did not couple (rad).
std::vector<double> sphere_phases(const Scene&, const Values<double>&);
/// What holds of the sample by whatever physics its picture is made.
void note_sphere(const Scene&, const Values<double>&, RenderPlan&);
/// The rays that judge methods; throws UserError like the plan.
Pilots sphere_pilots(const Scene&, const Demand&, const Values<double>&);

/// Throws UserError where modes run on rays of their own.
void add_sphere_jones(const Scene&, const RenderPlan&, const Values<double>&, JonesTable&);
/// The picture by the exact series, each mode on its own curved ray, or straight rays, as planned.
template <class S>
std::unique_ptr<SampleImage<S>> make_sphere_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kSphere;
/// How waves go through it.
extern const SampleWaves kSphereWaves;

}  // namespace birefit
