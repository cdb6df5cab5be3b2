#include "io/config/edit.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include <fmt/format.h>

#include "io/config/overrides.h"

namespace birefit {
namespace {

std::string number(double value) { return fmt::format("{}", value); }

std::string written(const NewStart& start) {
  return fmt::format("{{value: {}, fit: [{}, {}]}}", number(start.value), number(start.lower), number(start.upper));
}

/// The byte at a place of the text; nothing beyond it. Columns of yaml-cpp count bytes of what it reads as UTF-8
/// characters, so that lines with others are given up.
std::optional<std::size_t> offset_of(const std::string& text, const Where& where) {
  std::size_t at = 0;
  for (int line = 1; line < where.line; ++line) {
    at = text.find('\n', at);
    if (at == std::string::npos) return std::nullopt;
    ++at;
  }
  const std::size_t place = at + static_cast<std::size_t>(std::max(0, where.column - 1));
  if (where.line < 1 || place >= text.size()) return std::nullopt;
  const auto is_ascii = [](unsigned char c) { return c < 0x80 && c != '\n'; };
  if (!std::all_of(text.begin() + static_cast<std::ptrdiff_t>(at), text.begin() + static_cast<std::ptrdiff_t>(place),
                   is_ascii))
    return std::nullopt;
  return place;
}

/// Puts `with` in place of a scalar; says whether it could.
bool replace(std::string& text, const YamlNode& scalar, const std::string& with) {
  const auto at = offset_of(text, scalar.where);
  if (!at || !scalar.is_scalar()) return false;
  std::string before = scalar.text;
  if (scalar.quoted) {
    const char quote = text[*at];
    if (quote != '"' && quote != '\'') return false;
    before = quote + before + quote;
  }
  if (text.compare(*at, before.size(), before) != 0) return false;  // escapes, several lines
  text.replace(*at, before.size(), with);
  return true;
}

/// `{value: 3, fit: ..}` or `{fit: auto}`, in braces or in lines.
bool set_start(std::string& text, const YamlNode& node, const NewStart& start) {
  const auto fit =
      std::find_if(node.entries.begin(), node.entries.end(), [](const YamlEntry& entry) { return entry.key == "fit"; });
  if (fit == node.entries.end()) return false;
  if (const YamlNode* value = node.find("value")) return replace(text, *value, number(start.value));
  const auto at = offset_of(text, fit->where);
  if (!at || !replace(text, fit->value, fmt::format("[{}, {}]", number(start.lower), number(start.upper))))
    return false;
  const auto begin = offset_of(text, node.where);
  const bool braces = begin && text[*begin] == '{';
  const std::string blanks(static_cast<std::size_t>(std::max(0, fit->where.column - 1)), ' ');
  text.insert(*at, "value: " + number(start.value) + (braces ? ", " : "\n" + blanks));
  return true;
}

/// `center_px: {fit: auto}`, or no center_px at all: both axes at once.
bool set_centre(std::string& text, const YamlNode& tree, const std::string& path, const NewStart& x,
                const NewStart& y) {
  const std::string list = fmt::format("[{}, {}]", written(x), written(y));
  if (const YamlNode* node = node_at(tree, path)) {
    const auto begin = offset_of(text, node->where);
    if (!node->is_map() || node->entries.size() != 1 || !begin || text[*begin] != '{') return false;
    const std::size_t end = text.find('}', *begin);
    if (end == std::string::npos || text.substr(*begin, end - *begin).find('#') != std::string::npos) return false;
    text.replace(*begin, end + 1 - *begin, list);
    return true;
  }
  const std::size_t dot = path.rfind('.');
  const YamlNode* above = dot == std::string::npos ? nullptr : node_at(tree, path.substr(0, dot));
  if (!above || !above->is_map() || above->entries.empty()) return false;
  const auto first = offset_of(text, above->entries[0].where), begin = offset_of(text, above->where);
  if (!first || !begin) return false;
  const std::string blanks(static_cast<std::size_t>(std::max(0, above->entries[0].where.column - 1)), ' ');
  text.insert(*first, path.substr(dot + 1) + ": " + list + (text[*begin] == '{' ? ", " : "\n" + blanks));
  return true;
}

std::optional<double> number_of(const YamlNode& node) {
  if (!node.is_scalar() || node.quoted || node.text.empty()) return std::nullopt;
  char* end = nullptr;
  const double value = std::strtod(node.text.c_str(), &end);
  return *end == '\0' && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// Nothing where it is arithmetic or another text.
std::optional<double> value_in(const YamlNode& tree, const std::string& name) {
  const YamlNode* node = node_at(tree, name);
  if (node && node->is_map()) node = node->find("value");
  return node ? number_of(*node) : std::nullopt;
}

void list_numbers(const YamlNode& map, const std::string& above, std::vector<std::pair<std::string, double>>& numbers) {
  for (const YamlEntry& entry : map.entries) {
    const std::string path = above.empty() ? entry.key : above + "." + entry.key;
    if (entry.value.is_map() && !entry.value.find("fit"))
      list_numbers(entry.value, path, numbers);
    else if (const auto value = number_of(entry.value))
      numbers.emplace_back(path, *value);
  }
}

/// One start, or both of a centre: places move with every change, so that the text is read anew for each.
bool change(std::string& text, const std::vector<NewStart>& starts, std::size_t i) {
  Problems problems;
  const YamlNode tree = parse_yaml(text, "", problems);
  const NewStart& start = starts[i];
  if (value_in(tree, start.name) == start.value) return true;
  if (const YamlNode* node = node_at(tree, start.name); node && node->is_map()) return set_start(text, *node, start);
  const auto ends_in = [&](const char* axis) { return start.name.ends_with(axis); };
  if (!ends_in(".x") && !ends_in(".y")) return false;
  const std::string path = start.name.substr(0, start.name.size() - 2);
  const auto other = std::find_if(starts.begin(), starts.end(),
                                  [&](const NewStart& s) { return s.name == path + (ends_in(".x") ? ".y" : ".x"); });
  if (other == starts.end()) return false;
  return ends_in(".x") ? set_centre(text, tree, path, start, *other) : set_centre(text, tree, path, *other, start);
}

}  // namespace

std::string with_numbers(const std::string& text, const std::vector<std::pair<std::string, double>>& numbers) {
  std::string changed = text;
  for (const auto& [path, value] : numbers) {
    Problems ignored;
    const YamlNode tree = parse_yaml(changed, "", ignored);
    const YamlNode* node = node_at(tree, path);
    if (node && number_of(*node) && number_of(*node) != value) replace(changed, *node, number(value));
  }
  return changed;
}

std::vector<std::pair<std::string, double>> known_numbers(const std::string& text) {
  std::vector<std::pair<std::string, double>> numbers;
  Problems ignored;
  list_numbers(parse_yaml(text, "", ignored), "", numbers);
  return numbers;
}

std::string with_starts(const std::string& text, const std::vector<NewStart>& starts) {
  std::string changed = text;
  std::vector<std::string> set;
  Problems problems;
  try {
    bool all = true;
    for (std::size_t i = 0; i < starts.size() && all; ++i) all = change(changed, starts, i);
    const YamlNode tree = parse_yaml(changed, "", problems);
    for (const NewStart& start : starts) all = all && value_in(tree, start.name) == start.value;
    if (all && problems.empty()) return changed;
  } catch (const UserError&) {
    // Read the other way below.
  }
  for (const NewStart& start : starts) {
    const std::size_t at = start.name.size() - std::min<std::size_t>(2, start.name.size());
    // A list of two can only be set as a whole where there is none yet.
    const std::string axis = start.name.substr(at), path = start.name.substr(0, at);
    const auto other =
        std::find_if(starts.begin(), starts.end(), [&](const NewStart& s) { return s.name == path + ".y"; });
    if (axis == ".x" && other != starts.end())
      set.push_back(fmt::format("{}=[{}, {}]", path, written(start), written(*other)));
    else if (axis != ".y")
      set.push_back(start.name + "=" + written(start));
  }
  Problems ignored;
  const YamlNode tree = parse_config(text, "", set, ignored);
  return text_as_set(text, tree, set);
}

}  // namespace birefit
