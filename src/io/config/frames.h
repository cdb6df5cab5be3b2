#pragma once
// `{files, set_from}` of a config: which files, which pages of stacks, in which order, with which row of a table.

#include <optional>
#include <string>
#include <vector>

#include "birefit/series.h"
#include "io/config/pages.h"
#include "io/config/reader.h"

namespace birefit {

/// As the keys state it; one of `files` and `set_from` at least.
struct FramesAsked {
  std::optional<std::string> files;     ///< a pattern
  std::optional<std::string> set_from;  ///< a table under a line of names
  Where files_where, set_from_where;
  PageChoice page;  ///< of every file; pages that it leaves open are a frame each
};

/// Files that match, or pages of them, joined to the rows of the table: in its order, else by name with numbers counted
/// as such. Images are not opened. Mistakes go to the reader's problems.
void find_frames(ConfigReader& reader, const FramesAsked& asked, ImageSeries& series);

}  // namespace birefit
