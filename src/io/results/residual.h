#pragma once
// How large residuals are beside what was measured.

#include <string>

#include "birefit/fit.h"

namespace birefit {

/// Root mean square over all used pixels, each as a fraction of its micrograph's range of fitted values; where that is
/// even, of the range over all micrographs. NaN where these are alike, too.
double residual_fraction(const FitResult& result);
/// The same of one micrograph, of its own range.
double residual_fraction(const MicrographResult& micrograph);
/// "0.5 % of the signal range"; of even images that are alike "12.3 (even images have no range)", in units of the
/// values; "-" without used pixels.
std::string describe_residual(const FitResult& result);

}  // namespace birefit
