#pragma once
// The `micrographs: {files, set_from, shared, along}` of a config: which images, in which order, with which numbers.

#include <filesystem>
#include <string>
#include <vector>

#include "birefit/series.h"
#include "io/config/yaml.h"

namespace birefit {

/// Is this `micrographs:` a series?
bool is_series(const YamlNode& micrographs);
/// The same of a whole config; false for what cannot be read.
bool holds_series(const std::string& text, const std::vector<std::string>& set);

/// What the block says, with the images found and the table joined to them. Images are not opened. Throws UserError.
ImageSeries read_series(const std::filesystem::path& path, std::string text, const std::vector<std::string>& set = {});

/// Reads a frame and its image, and throws what is wrong with them.
void check_frame(const ImageSeries& series, std::size_t frame);

/// A frame's cells as numbers of a config, at their places in the table.
std::vector<YamlNode> cell_nodes(const SeriesFrame& frame);

}  // namespace birefit
