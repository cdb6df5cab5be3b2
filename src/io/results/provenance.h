#pragma once
// Of what a result was made, and when: two keys of fit.json.

#include <nlohmann/json.hpp>

#include "birefit/io.h"

namespace birefit {

/// What determines a fit beside the machine: program, version, the library of Fourier transforms, and SHA-256 of the
/// config and of every file that was read for it.
nlohmann::ordered_json made_by(const Config& config);

/// What differs between two runs of the same: when it ended (UTC), the seconds it took, the machine's name.
nlohmann::ordered_json this_run(double seconds);

}  // namespace birefit
