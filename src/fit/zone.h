#pragma once
// Pixels that the sample itself takes out of a fit: around the forces on a photoelastic disc, along its rim and beyond.
// Where they are depends on parameters that the fit may search for, so that they have to follow these.

#include <functional>

#include "birefit/fit.h"

namespace birefit::estimation {

/// The usable pixels of a micrograph without those that its sample takes out where `theta` puts it; the mask as it is
/// for samples that take out none.
Mask fitted_pixels(const Picture& micrograph, const Theta& theta);

/// A fit whose zones follow its parameters: first without whatever a zone may cover within the bounds, then with the
/// zones at the estimate, again from there until they stay. `fit`: what fits with the masks as they are, and all of it
/// where no sample has a zone.
FitResult fit_following_zones(const FitJob& job, const std::function<FitResult(const FitJob&)>& fit);

}  // namespace birefit::estimation
