#include "io/config/overrides.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace birefit {
namespace {

/// Everything below a node stands where the item of `--set` says, which is no file.
void place(YamlNode& node, const Where& where) {
  node.where = where;
  for (YamlNode& item : node.items) place(item, where);
  for (YamlEntry& entry : node.entries) {
    entry.where = where;
    place(entry.value, where);
  }
}

YamlNode parse_value(const std::string& text, const Where& where) {
  Problems problems;
  YamlNode document;
  try {
    document = parse_yaml("value: " + text, where.file, problems);
    problems.throw_if_any();
  } catch (const UserError& error) {
    const Problem& first = error.problems().front();
    throw UserError(where, first.what, first.hint);
  }
  if (document.entries.size() != 1) throw UserError(where, "the value must be one number, word, list or map");
  YamlNode value = std::move(document.entries[0].value);
  place(value, where);
  return value;
}

/// How far the first step of "name[2].rest" reaches; a step of no name is that of a list in a list.
struct Step {
  std::string name;
  std::vector<int> indices;  ///< behind the name, in brackets
  std::string rest;
};

std::optional<Step> first_step(const std::string& path) {
  Step step;
  const std::size_t end = std::min(path.find('.'), path.size());
  std::size_t at = std::min(path.find('['), end);
  step.name = path.substr(0, at);
  if (step.name.empty()) return std::nullopt;
  while (at < end) {
    const std::size_t close = path.find(']', at);
    int index = 0;
    if (path[at] != '[' || close == std::string::npos || close > end) return std::nullopt;
    const auto [stop, error] = std::from_chars(path.data() + at + 1, path.data() + close, index);
    if (error != std::errc{} || stop != path.data() + close || index < 0) return std::nullopt;
    step.indices.push_back(index);
    at = close + 1;
  }
  if (end < path.size()) {
    step.rest = path.substr(end + 1);
    if (step.rest.empty()) return std::nullopt;
  }
  return step;
}

/// Images and tables are counted from 0 as everywhere, items of other lists from 1.
int first_index(const std::string& list) { return list == "micrographs" || list == "signal" ? 0 : 1; }

class Override {
 public:
  explicit Override(const std::string& item) : where_{"--set " + item} {
    const std::size_t equals = item.find('=');
    if (equals == std::string::npos || equals == 0)
      throw UserError(where_, "must be path=value", "for example --set sample.droplet.diameter_um=9.3");
    path_ = item.substr(0, equals);
    value_ = parse_value(item.substr(equals + 1), where_);
  }

  void apply(YamlNode& tree) { descend(tree, path_, ""); }

 private:
  [[noreturn]] void fail(const std::string& what, const std::string& hint = {}) const {
    throw UserError(where_, what, hint);
  }

  /// Sets what `path` names below the map `node`, which is at `above`.
  void descend(YamlNode& node, const std::string& path, const std::string& above) {
    if (node.kind == YamlNode::Kind::null) {
      node.kind = YamlNode::Kind::map;
      node.where = where_;
    }
    if (node.is_sequence()) return axis(node, path, above);
    if (!node.is_map()) fail((above.empty() ? "the config" : above) + " is " + node.describe() + ", which has no keys");
    // Keys of `set:` are paths themselves.
    if (node.find(path)) return set_key(node, path);
    const auto own = std::find_if(node.entries.begin(), node.entries.end(),
                                  [](const YamlEntry& entry) { return entry.key == "set" && entry.value.is_map(); });
    if (own != node.entries.end() && own->value.find(path)) return set_key(own->value, path);
    const std::optional<Step> step = first_step(path);
    if (!step) fail("is no path of keys", "for example micrographs[0].set.sample.crystal.bias_v");
    const std::string here = above.empty() ? step->name : above + "." + step->name;
    if (step->rest.empty() && step->indices.empty()) return set_key(node, step->name);
    YamlNode* next = &entry_of(node, step->name).value;
    const int first = first_index(step->name);
    for (const int index : step->indices) {
      if (!next->is_sequence()) fail(here + " is " + next->describe() + ", not a list");
      const int at = index - first;
      if (at < 0 || at >= static_cast<int>(next->items.size()))
        fail(here + " has the items " + std::to_string(first) + " to " +
             std::to_string(first + static_cast<int>(next->items.size()) - 1));
      next = &next->items[at];
    }
    if (step->rest.empty())
      *next = value_;
    else
      descend(*next, step->rest, here);
  }

  /// `center_px: [x, y]` and its like.
  void axis(YamlNode& list, const std::string& path, const std::string& above) {
    const std::size_t at = path.size() == 1 ? std::string("xyz").find(path[0]) : std::string::npos;
    if (at >= list.items.size()) fail(above + " is a list, which has no " + path, above + "[1] is its first item");
    list.items[at] = value_;
  }

  YamlEntry& entry_of(YamlNode& map, const std::string& key) {
    for (YamlEntry& entry : map.entries)
      if (entry.key == key) return entry;
    map.entries.push_back({key, where_, {}});
    return map.entries.back();
  }

  void set_key(YamlNode& map, const std::string& key) {
    if (value_.kind == YamlNode::Kind::null) {
      std::erase_if(map.entries, [&](const YamlEntry& entry) { return entry.key == key; });
    } else {
      YamlEntry& entry = entry_of(map, key);
      entry.where = where_;
      entry.value = value_;
    }
  }

  Where where_;
  std::string path_;
  YamlNode value_;
};

/// A scalar as it can stand in braces.
std::string scalar_text(const std::string& text, bool quoted) {
  const bool plain = !quoted && !text.empty() && text.front() != ' ' && text.back() != ' ' && text.front() != '-' &&
                     text.find_first_of(",[]{}#&*!|>'\"%@`:?\\\n\t") == std::string::npos;
  const bool number = !quoted && !text.empty() && text.find_first_not_of("0123456789+-.eE") == std::string::npos;
  if (plain || number) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (c == '\n')
      out += "\\n";
    else if (c == '\t')
      out += "\\t";
    else
      out += c;
  }
  return out + "\"";
}

std::string in_line(const YamlNode& node) {
  std::string out;
  switch (node.kind) {
    case YamlNode::Kind::null:
      return "null";
    case YamlNode::Kind::scalar:
      return scalar_text(node.text, node.quoted);
    case YamlNode::Kind::sequence:
      for (const YamlNode& item : node.items) out += (out.empty() ? "" : ", ") + in_line(item);
      return "[" + out + "]";
    case YamlNode::Kind::map:
      for (const YamlEntry& entry : node.entries)
        out += (out.empty() ? "" : ", ") + scalar_text(entry.key, false) + ": " + in_line(entry.value);
      return "{" + out + "}";
  }
  return out;
}

/// Blocks of a line a key where they hold blocks, else in a line.
void append_block(const YamlNode& map, const std::string& indent, std::string& out) {
  constexpr std::size_t kDeepest = 6;
  for (const YamlEntry& entry : map.entries) {
    out += indent + scalar_text(entry.key, false) + ":";
    const bool block = entry.value.is_map() && indent.size() < kDeepest &&
                       std::any_of(entry.value.entries.begin(), entry.value.entries.end(), [](const YamlEntry& inner) {
                         return inner.value.is_map() || inner.value.is_sequence();
                       });
    if (block) {
      out += "\n";
      append_block(entry.value, indent + "  ", out);
    } else if (entry.value.is_sequence() && !entry.value.items.empty() && entry.value.items[0].is_map()) {
      out += "\n";
      for (const YamlNode& item : entry.value.items) out += indent + "  - " + in_line(item) + "\n";
    } else {
      out += " " + in_line(entry.value) + "\n";
    }
  }
}

}  // namespace

YamlNode parse_config(const std::string& text, const std::string& file, const std::vector<std::string>& set,
                      Problems& problems) {
  YamlNode tree = parse_yaml(text, file, problems);
  for (const std::string& item : set) {
    try {
      Override(item).apply(tree);
    } catch (const UserError& error) {
      problems.add(error);
    }
  }
  return tree;
}

const YamlNode* node_at(const YamlNode& tree, const std::string& path) {
  if (tree.is_sequence()) {  // `center_px: [x, y]` and its like
    const std::size_t at = path.size() == 1 ? std::string("xyz").find(path[0]) : std::string::npos;
    return at < tree.items.size() ? &tree.items[at] : nullptr;
  }
  if (const YamlNode* node = tree.find(path)) return node;
  if (const YamlNode* own = tree.find("set"); own && own->is_map())
    if (const YamlNode* node = own->find(path)) return node;
  const std::optional<Step> step = first_step(path);
  const YamlNode* next = step ? tree.find(step->name) : nullptr;
  if (!next) return nullptr;
  for (const int index : step->indices) {
    const int at = index - first_index(step->name);
    if (!next->is_sequence() || at < 0 || at >= static_cast<int>(next->items.size())) return nullptr;
    next = &next->items[static_cast<std::size_t>(at)];
  }
  return step->rest.empty() ? next : node_at(*next, step->rest);
}

std::string text_as_set(const std::string& text, const YamlNode& tree, const std::vector<std::string>& set) {
  if (set.empty()) return text;
  std::string out = "# As set on the command line; comments of the file left out.\n";
  for (std::string item : set) {
    std::replace(item.begin(), item.end(), '\n', ' ');
    out += "#   --set " + item + "\n";
  }
  return out + text_of(tree);
}

std::string text_of(const YamlNode& tree) {
  std::string out;
  append_block(tree, "", out);
  return out;
}

}  // namespace birefit
