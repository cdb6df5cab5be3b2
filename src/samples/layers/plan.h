#pragma once
// Plans of cells, plates and slabs.

#include <utility>

#include "samples/jones_table.h"
#include "samples/pilots.h"
#include "samples/planning.h"

namespace birefit {

struct SampleKind;  // samples/kind.h

/// Retardance phases in a few directions, and what else makes fringes of a cell (rad).
std::vector<double> planar_phases(const Scene&, const Values<double>&);
/// The directions, as tan(incidence) (cos azimuth, sin azimuth), on which cells, plates and slabs are judged: of a list
/// at most `most`, from the flattest to the steepest.
std::vector<std::pair<double, double>> pilot_directions(const Scene& scene, const Values<double>& value,
                                                        std::size_t most = 12);

/// References to the temperatures of a heated plate, which its indices are computed at; none of anything else. Throws
/// UserError where the material has no law of temperature.
std::vector<ParameterRef> heat_temperatures(const Scene&);

/// The rays that judge methods.
Pilots planar_pilots(const Scene&, const Demand&, const Values<double>&);

/// Of a slab one row a direction of the microscope, else one a pixel.
void add_planar_jones(const Scene&, const RenderPlan&, const Values<double>&, JonesTable&);
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kLayers;

}  // namespace birefit
