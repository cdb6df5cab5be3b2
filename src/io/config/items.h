#pragma once
// `micrographs:` of a config: which images one fit takes together, and what each has for itself.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "birefit/measurement.h"
#include "birefit/series.h"
#include "io/config/pages.h"
#include "io/config/pixels.h"
#include "io/config/reader.h"

namespace birefit {

/// One image of `micrographs:`.
struct Item {
  std::optional<std::string> image;
  Where image_where;
  PageChoice page;
  std::optional<PixelRect> roi;  ///< of its own, in place of the one that all have
  Where roi_where;
  std::vector<std::pair<std::string, const YamlNode*>> set;  ///< parameter paths and what the image gives them
  std::vector<Where> set_where;
  std::vector<std::pair<std::string, Where>> own;  ///< paths, or the beginnings of some, that it fits for itself
  std::string axis;  ///< of `set`, may be no parameter: a column that a series is only drawn along
};

/// What the numbers of `Item::set` stand in where they come from a table.
using TableNodes = std::vector<std::vector<YamlNode>>;

/// The images of a list, or of `{files, set_from}` in one fit; empty without the key, and with a problem.
std::vector<Item> read_items(ConfigReader& reader, const Block& root, const Config& config, TableNodes& nodes);
/// The frames from `first` to before `last` of a series; mistakes that were found in them before become problems.
std::vector<Item> items_of(ConfigReader& reader, const ImageSeries& series, std::size_t first, std::size_t last,
                           TableNodes& nodes);

/// A micrograph of the shared scene with its own values of what its `set:` and `own:` name. `index`: of the item in
/// `list`, which the names of its parameters begin with.
Picture apply_set(ConfigReader& reader, const Picture& shared, const Item& item, std::size_t index,
                  const std::string& list = "micrographs");
/// The same of one of several colours, "r", "g" or "b", whose own values all images share: a map of parameter paths.
Picture apply_colour(ConfigReader& reader, const Picture& shared, const std::string& colour, const YamlNode& set);

}  // namespace birefit
