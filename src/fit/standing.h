#pragma once
// How a job stands where its fit begins, or where it ended: for whoever evaluates it there without searching.

#include "birefit/fit.h"
#include "fit/problem/frame.h"

namespace birefit::estimation {

/// In its first branch, with one memo for all plans, without the pixels that samples take out of their pictures where
/// the job begins.
FitJob as_begun(FitJob job);
/// In the branch that was reported, by the physics that the fit ended with; what is stated and not known exactly where
/// the fit had it.
FitJob as_ended(FitJob job, const FitResult& result);
/// The frames of such a job with the plans, the noise and the pixels that the fit ended with.
void take_from(const FitResult& result, Frames& frames);

}  // namespace birefit::estimation
