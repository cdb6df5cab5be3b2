#pragma once
// fit.json as it is read again: by `prior`, and by a series that goes on.

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "birefit/error.h"

namespace birefit {

/// The document in a fit.json. Throws UserError at `where`: no such file, too large, no JSON.
nlohmann::json read_fit_file(const std::filesystem::path& path, const Where& where);

/// SHA-256 over all that a fit found, in 64 hexadecimal digits: over the document without its keys `checksum` and
/// `run`, whatever its spaces and the order of its keys.
std::string checksum_of(nlohmann::json fit);

}  // namespace birefit
