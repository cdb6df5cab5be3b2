#pragma once
// Traps for wave optics: whole pictures of spheres by the exact series, by propagation and by the march of Maxwell's
// equations.

#include "birefit/study.h"

namespace birefit::study {

/// Series: worst of some pixels against the same solution without its tables, more orders, the ball cut in two.
/// Propagation and march: picture_error (samples/waves/wave.h) against the series; where the director has none, of
/// propagation against march, and their estimates added.
void measure_wave_traps(bool quick, const std::function<void(const std::string&)>& say,
                        std::vector<StressPoint>& points);

}  // namespace birefit::study
