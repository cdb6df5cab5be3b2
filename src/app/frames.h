#pragma once
// What `series` and `watch` do with one image after the other: each is fitted into a folder of its own, once.

#include <filesystem>
#include <functional>
#include <optional>

#include "birefit/series.h"

namespace birefit {

/// What a killed run left half written in a folder.
void remove_parts(const std::filesystem::path& folder);

/// What became of a frame.
struct FrameDone {
  std::optional<RecordedFit> record;  ///< as later runs will read it; none: interrupted, or the frame is unreadable
  std::optional<FitResult> fresh;     ///< the same with its pictures; none where the record was up to date
};

/// Fits a frame as `config` has it, from where `neighbour` ended (null: from its own start), into the folder `place`,
/// unless the fit there is of the same input. Marks the frame `unreadable` where its picture is of no use. What was
/// interrupted leaves nothing. `begin`: called before there is a fit to do, with options still to be set.
FrameDone do_frame(SeriesFrame& frame, Config& config, const FitResult* neighbour, const std::filesystem::path& place,
                   const std::function<void()>& begin);

}  // namespace birefit
