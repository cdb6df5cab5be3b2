#pragma once
// The blocks `fit` and `prior` of a config.

#include "birefit/fit.h"
#include "io/config/reader.h"

namespace birefit {

/// Mistakes go to the reader's problems; what is not given stays as it is.
void read_fit_options(ConfigReader& reader, const Block& root, FitOptions& options);
/// Of parameters that the job fits, from an earlier fit's fit.json.
void read_prior(ConfigReader& reader, const Block& root, FitJob& job);

}  // namespace birefit
