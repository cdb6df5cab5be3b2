#pragma once
// The vocabulary in which the sections of a config are read: a block of known keys, a number that may be a parameter, a
// choice of words. Every mistake goes to `problems` and reading goes on with a harmless stand-in, so that one run
// reports all of them.

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "birefit/in_memory.h"
#include "birefit/io.h"
#include "birefit/light.h"
#include "birefit/number_spec.h"
#include "io/config/tied_number.h"
#include "io/config/yaml.h"

namespace birefit {

/// "(0, 10000]".
std::string range_of(const NumberSpec& spec);

/// The value most likely meant by one outside the range: a lost sign, nm for um, Celsius for kelvin. "" when none is.
std::string unit_hint(double value, const NumberSpec& spec);

/// A map of the config. `node` is null when the block is absent or unusable; what is read from it then is the fallback.
struct Block {
  const YamlNode* node = nullptr;
  std::string path;  ///< "sample.droplet", "" for the whole file
  Where where;
  bool reported = false;  ///< why it is unusable was said already: do not also complain of missing keys

  const YamlNode* find(const std::string& key) const { return node ? node->find(key) : nullptr; }
  std::string path_of(const std::string& key) const { return path.empty() ? key : path + "." + key; }
};

class ConfigReader {
 public:
  ConfigReader(std::string file, std::filesystem::path folder, ConfigUse use)
      : file(std::move(file)), folder(std::move(folder)), use(use) {}

  std::string file;              ///< as the user wrote it
  std::filesystem::path folder;  ///< relative paths in the config start here
  ConfigUse use;
  Problems problems;
  ParameterTable table;
  std::vector<std::string> warnings;
  std::vector<std::string> misfit;  ///< FitJob::misfit
  /// Range of every number of the config by path, given or defaulted: what `set:` of a micrograph may name.
  std::map<std::string, NumberSpec> specs;
  std::map<std::string, ParameterRef> refs;
  std::vector<TiedNumber> ties;
  TieStarts tie_starts;    ///< what is known of them from reading the config before
  std::set<int> replaced;  ///< parameters instead of which an image has one of its own
  /// Every file that was asked for.
  std::set<std::filesystem::path> inputs;
  /// Paths that an unknown key was probably meant for: not also reported as missing.
  std::set<std::string> misspelt;
  /// Paths that every micrograph sets for itself: the shared blocks need not give them.
  std::vector<std::string> set_everywhere;
  /// A scene without polarizers: what it shows is the retardance itself.
  bool polarizers = true;
  /// `physics: {rays: auto}`: the fit chooses.
  Demand demand;  ///< of the config, as far as it is read
  bool choose_rays = true;
  /// `physics: {ceiling: auto}` on a sphere: waves where they pay, within the time given for a fit (s).
  bool choose_waves = false;
  double max_seconds = 60;
  double model_tolerance = 0.01;
  /// What the camera's channels see, by their names; "" of a camera without colours.
  std::map<std::string, std::shared_ptr<const SpectralTable>> camera;
  Block crosstalk;  ///< `camera.crosstalk`, read as colours are chosen

  /// The block at a key, its keys checked against `known`.
  Block block(const Block& parent, const std::string& key, const std::vector<std::string>& known, bool required);
  /// The same for a node that is no value of a key (an item of a list).
  Block block_of(const YamlNode& node, const std::string& path, const std::vector<std::string>& known);
  void check_keys(const YamlNode& node, const std::string& path, const std::vector<std::string>& known);
  void missing(const Block& block, const std::string& key, const std::string& hint = {});

  /// A key stands in the block, or every micrograph sets it.
  bool given(const Block& block, const std::string& key) const {
    return block.find(key) ||
           std::find(set_everywhere.begin(), set_everywhere.end(), block.path_of(key)) != set_everywhere.end();
  }

  /// A number or parameter; without a fallback it is required.
  ParameterRef number(const Block& block, const std::string& key, const NumberSpec& spec,
                      std::optional<double> fallback = std::nullopt);
  /// A number or parameter at a node, under its own path ("micrograph.center_px.x").
  ParameterRef number_at(const YamlNode& node, const std::string& path, const NumberSpec& spec);
  /// A number of the table that the config does not give.
  ParameterRef constant(const std::string& path, const NumberSpec& spec, double value);

  /// Settings that are no parameters. Nothing when absent or wrong (then reported).
  std::optional<double> plain(const Block& block, const std::string& key, const NumberSpec& spec);
  std::optional<int> integer(const Block& block, const std::string& key, int lower, int upper);
  std::optional<std::string> text(const Block& block, const std::string& key);
  std::optional<std::string> choice(const Block& block, const std::string& key, const std::vector<std::string>& words);
  std::optional<std::vector<int>> integers(const Block& block, const std::string& key, std::size_t count,
                                           const std::string& shape);

  /// What a number may be while a fit goes on: its bounds, or how far what it is tied to may take it; else its value.
  /// Not finite where that is not known yet.
  std::pair<double, double> span_of(ParameterRef ref) const;
  /// Fitted, or tied to other numbers.
  bool varies(ParameterRef ref) const { return table[ref].free || tie_starts.contains(table[ref].name); }

  /// A finite number within the spec's range, else nothing and a problem. `name` is the key shown.
  std::optional<double> value_of(const YamlNode& node, const std::string& name, const NumberSpec& spec);

  /// A file that the config names, or an array of that name; noted among `inputs`.
  std::filesystem::path resolve(const std::string& path) {
    const std::filesystem::path given(path);
    const bool stays = given.is_absolute() || image_in_memory(given) || field_in_memory(given);
    inputs.insert(stays ? given : folder / given);
    return stays ? given : folder / given;
  }

  const InMemory* in_memory = nullptr;  ///< arrays that are read in place of files of their names
  /// The array in place of a file; null: it is a file.
  const ArrayImage* image_in_memory(const std::filesystem::path& file) const;
  const std::string* field_in_memory(const std::filesystem::path& file) const;

 private:
  std::optional<double> finite(const YamlNode& node, const std::string& name);
  std::optional<double> arithmetic(const YamlNode& node, const std::string& name);
  bool read_tie(const YamlNode& node, const std::string& name, const NumberSpec& spec, ParameterRef ref);
};

/// A config as text; UserError when it cannot be one.
std::string read_text(const std::filesystem::path& path);

/// "a, b and c".
std::string list_words(const std::vector<std::string>& words);

/// A number as short as it can be written.
std::string show(double value);

}  // namespace birefit
