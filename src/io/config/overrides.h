#pragma once
// `--set path=value` of the command line: a config's tree is changed before it is read, so that a value set there is
// checked like one in the file.

#include <string>
#include <vector>

#include "io/config/yaml.h"

namespace birefit {

/// parse_yaml, then every item of `set` ("path=value") in turn. A path is that of a key as messages and results have it
/// ("sample.droplet.diameter_um", "micrograph.center_px.x", "micrographs[0].sample.crystal.bias_v"); the value is YAML;
/// an empty one leaves the key out. Nodes that were set have the item itself as their place. Items that cannot be
/// applied go to `problems`.
YamlNode parse_config(const std::string& text, const std::string& file, const std::vector<std::string>& set,
                      Problems& problems);

/// The text of a config that `set` changed, to be kept with results: a config of its own, less comments. Without
/// `set` the text as it is.
std::string text_as_set(const std::string& text, const YamlNode& tree, const std::vector<std::string>& set);

/// A tree as the text of a config.
std::string text_of(const YamlNode& tree);
/// The node that a path of `--set` names, or nullptr.
const YamlNode* node_at(const YamlNode& tree, const std::string& path);

}  // namespace birefit
