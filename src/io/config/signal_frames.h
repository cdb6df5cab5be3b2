#pragma once
// `signal: {frames, roi_px}`: the mean of a region over frames or pages of a stack as the rows of a table.

#include <optional>

#include "io/config/micrograph.h"
#include "io/config/signal.h"
#include "io/files/table.h"

namespace birefit {

/// The table of an item with frames: the columns of `set_from`, `frame` (from 0), and `signal`, the mean of the pixels
/// that the `micrograph:` block leaves in, in its light. Frames that cannot be read or are saturated in the region are
/// left out, which is said. Nothing, with a problem, where there is none.
std::optional<TextTable> table_of_frames(ConfigReader& reader, const SignalItem& item,
                                         const MicrographSettings& settings);

}  // namespace birefit
