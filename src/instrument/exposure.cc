#include "instrument/exposure.h"

namespace birefit {

Exposure exposure_of(const Microscope& microscope) {
  const Direction direction = microscope.directions.empty() ? Direction{} : microscope.directions.front();
  return {{BeamMaker(microscope, direction)}, {1.0}};
}

}  // namespace birefit
