#pragma once
// A YAML document as a small tree in which every key and value knows its line and column. Read through yaml-cpp's
// events and not through its nodes, which forget the places of keys, keep duplicate keys and expand aliases.

#include <string>
#include <vector>

#include "birefit/error.h"

namespace birefit {

/// Nesting beyond this is refused: no config needs a tenth of it.
inline constexpr int kMaxYamlDepth = 64;

struct YamlEntry;

struct YamlNode {
  enum class Kind { null, scalar, sequence, map };
  Kind kind = Kind::null;
  Where where;
  std::string text;                ///< scalars
  bool quoted = false;             ///< a quoted scalar is text even if it looks like a number
  std::vector<YamlNode> items;     ///< sequences
  std::vector<YamlEntry> entries;  ///< maps, in the order of the file, each key once

  bool is_map() const { return kind == Kind::map; }
  bool is_sequence() const { return kind == Kind::sequence; }
  bool is_scalar() const { return kind == Kind::scalar; }
  /// The value of a key; nullptr when there is none (or this is no map).
  const YamlNode* find(const std::string& key) const;
  /// "a number", "text", "a list", ... for messages.
  std::string describe() const;
};

struct YamlEntry {
  std::string key;
  Where where;  ///< of the key
  YamlNode value;
};

/// Parses one document. `file` is the name used in messages. Duplicate keys are added to `problems` and the first one
/// is kept; what leaves no tree to work on (syntax, aliases, tags, nesting, several documents, no text) is thrown.
YamlNode parse_yaml(const std::string& text, const std::string& file, Problems& problems);

/// The smallest number of insertions, deletions, replacements and swaps of neighbours from a to b.
int edit_distance(const std::string& a, const std::string& b);

/// The known word nearest to `word`, or "" when none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace birefit
