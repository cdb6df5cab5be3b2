#pragma once
// `birefit new KIND --demo DIR`: a config and the pictures it names, so that it runs as printed.

#include <filesystem>

#include "io/kinds/kinds.h"

namespace birefit {

/// Makes `folder` with KIND.yaml, what it names, and truth.csv (name,value), and says on stdout what to run. Throws
/// UserError where the folder holds one already or cannot be written.
void make_demo(const Kind& kind, const std::filesystem::path& folder);

}  // namespace birefit
