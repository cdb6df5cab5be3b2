#include "io/config/reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include <fmt/format.h>

#include "io/files/table.h"
#include "io/files/whole_file.h"
#include "io/images/asked.h"

namespace birefit {
namespace {

/// The key a path ends in, which is what the user wrote.
std::string last_key(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  std::string key = dot == std::string::npos ? path : path.substr(dot + 1);
  // "center_px.x" alone would read "x".
  if (key.size() == 1 && dot != std::string::npos) return last_key(path.substr(0, dot)) + "." + key;
  return key;
}

/// More is no config.
constexpr std::uintmax_t kMaxConfigMb = 4;

}  // namespace

std::string read_text(const std::filesystem::path& path) {
  const Where where{path.string()};
  std::error_code code;
  const auto status = std::filesystem::status(path, code);
  if (!std::filesystem::exists(status)) throw UserError(where, "does not exist");
  if (std::filesystem::is_directory(status)) throw UserError(where, "is a folder, expected a config file");
  return read_whole(path, kMaxConfigMb, where, "", "is this a config file?");
}

std::string show(double value) { return fmt::format("{:.10g}", value); }

std::string list_words(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

std::string range_of(const NumberSpec& spec) {
  const std::string low = std::isfinite(spec.lower) ? show(spec.lower) : "-infinity";
  const std::string high = std::isfinite(spec.upper) ? show(spec.upper) : "infinity";
  return (spec.lower_open || !std::isfinite(spec.lower) ? "(" : "[") + low + ", " + high +
         (spec.upper_open || !std::isfinite(spec.upper) ? ")" : "]");
}

std::string unit_hint(double value, const NumberSpec& spec) {
  struct Guess {
    double value;
    bool unit;  // a mistaken unit, not a lost sign
  };
  std::vector<Guess> guesses;
  if (value < 0) {
    guesses = {{-value, false}};
  } else if (spec.unit == "um") {
    guesses = {{value / 1e3, true}, {value * 1e3, true}, {value * 1e6, true}};
  } else if (spec.unit == "nm") {
    guesses = {{value * 1e3, true}, {value * 1e9, true}, {value / 10, true}};
  } else if (spec.unit == "K") {
    guesses = {{value + 273.15, true}};
  } else if (spec.percent) {
    guesses = {{value / 100, false}};
  }
  for (const Guess& guess : guesses)
    if (guess.value != 0 && spec.contains(guess.value))
      return "did you mean " + show(guess.value) + "?" + (guess.unit ? " the key is in " + spec.unit : "");
  return {};
}

void ConfigReader::check_keys(const YamlNode& node, const std::string& path, const std::vector<std::string>& known) {
  for (const YamlEntry& entry : node.entries) {
    if (std::find(known.begin(), known.end(), entry.key) != known.end()) continue;
    const std::string near = nearest_word(entry.key, known);
    if (!near.empty()) misspelt.insert(path.empty() ? near : path + "." + near);
    const std::string shown = entry.key.size() > 60 ? entry.key.substr(0, 57) + "..." : entry.key;
    problems.add(entry.where, "unknown key " + shown + (path.empty() ? "" : " in " + path),
                 !near.empty()   ? "did you mean " + near + "?"
                 : known.empty() ? "no keys are expected here"
                                 : "known here: " + list_words(known));
  }
}

Block ConfigReader::block_of(const YamlNode& node, const std::string& path, const std::vector<std::string>& known) {
  Block block{nullptr, path, node.where};
  if (node.is_map()) {
    check_keys(node, path, known);
    block.node = &node;
  } else {
    problems.add(node.where, last_key(path) + " must be a map of keys" +
                                 (known.empty() ? "" : " (" + list_words(known) + ")") + ", found " + node.describe());
    block.reported = true;
  }
  return block;
}

Block ConfigReader::block(const Block& parent, const std::string& key, const std::vector<std::string>& known,
                          bool required) {
  const YamlNode* node = parent.find(key);
  if (node) {
    Block block = block_of(*node, parent.path_of(key), known);
    // What a block lacks is said at its key, not at the first key it has.
    for (const YamlEntry& entry : parent.node->entries)
      if (entry.key == key) block.where = entry.where;
    return block;
  }
  Block block{nullptr, parent.path_of(key), parent.where, parent.reported};
  if (required) {
    missing(parent, key);
    block.reported = true;
  }
  return block;
}

void ConfigReader::missing(const Block& block, const std::string& key, const std::string& hint) {
  if (block.reported || misspelt.count(block.path_of(key))) return;
  problems.add(block.where, (block.path.empty() ? "the config" : block.path) + " needs " + key, hint);
}

std::optional<double> ConfigReader::finite(const YamlNode& node, const std::string& name) {
  if (!node.is_scalar()) {
    problems.add(node.where, name + " must be a number, found " + node.describe());
    return std::nullopt;
  }
  if (Expression::is_one(node.text)) return arithmetic(node, name);
  if (node.quoted) {
    problems.add(node.where, name + " must be a number, found " + node.describe(),
                 parse_number(node.text) ? "write it without quotes" : "");
    return std::nullopt;
  }
  const std::optional<double> value = parse_number(node.text);
  if (value && std::isfinite(*value)) return value;
  std::string word = lower_case(node.text);
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.erase(0, 1);
  if (!word.empty() && word[0] == '.') word.erase(0, 1);
  if (value || word == "nan" || word == "inf" || word == "infinity") {
    problems.add(node.where, name + " = " + node.describe() + " is not a finite number");
    return std::nullopt;
  }
  const std::size_t digits = node.text.find_first_not_of("0123456789+-.eE");
  const std::size_t comma = node.text.find(',');
  std::string hint = comma == std::string::npos ? number_hint(node.text) : "";
  if (!hint.empty()) {
    // Said.
  } else if (comma != std::string::npos && comma == digits) {
    std::string with_point = node.text;
    with_point[comma] = '.';
    if (parse_number(with_point)) hint = "did you mean " + with_point + "? write a decimal point";
  } else if (digits != std::string::npos && digits > 0) {
    std::string number = node.text.substr(0, digits);
    while (!number.empty() && (number.back() == 'e' || number.back() == 'E')) number.pop_back();
    const std::size_t word = node.text.find_first_not_of(" ", digits);
    const std::string unit = word == std::string::npos ? "" : node.text.substr(word);
    if (parse_number(number) && name.ends_with("_" + lower_case(unit)))
      hint = "did you mean " + number + "? the unit is part of the key";
    else if (!unit.empty() && std::isalpha(static_cast<unsigned char>(unit.front())))
      hint = "the unit is part of the key: give the number in it";
  }
  problems.add(node.where, name + " must be a number, found " + node.describe(), hint);
  return std::nullopt;
}

/// Of numbers alone, "19.28 / 5.21", wherever there may be one.
std::optional<double> ConfigReader::arithmetic(const YamlNode& node, const std::string& name) {
  try {
    const Expression expression(node.text);
    if (const double value = expression.is_plain() ? expression.value({}) : 0; !std::isfinite(value))
      problems.add(node.where, name + " = " + node.text + " is not a finite number");
    else if (!expression.is_plain())
      problems.add(node.where, name + " must be a number, found an expression that reads others",
                   "numbers that may be fitted can be tied, here only numbers can stand");
    else
      return value;
  } catch (const ExpressionError& error) {
    problems.add(within(node, error.column), name + " = " + node.text + ": " + error.wrong, error.hint);
  }
  return std::nullopt;
}

/// True where the number is tied to others: its value follows once all names are known.
bool ConfigReader::read_tie(const YamlNode& node, const std::string& name, const NumberSpec& spec, ParameterRef ref) {
  const YamlNode* word = node.is_map() ? node.find("value") : &node;
  std::shared_ptr<Expression> law = word && !spec.fixed ? tie_in(*word) : nullptr;
  if (!law) return false;
  Parameter& parameter = table[ref];
  if (spec.linear)
    problems.add(word->where, name + " is solved for once all else is known: it cannot be tied",
                 "give it as a number, or {fit: auto}");
  for (const YamlEntry& entry : node.entries)
    if (entry.key != "value")
      problems.add(entry.where, name + " is tied to other numbers and has " + entry.key,
                   "give that to the numbers it follows from");
  const auto start = tie_starts.find(parameter.name);
  parameter.value = start != tie_starts.end() ? start->second.value : std::numeric_limits<double>::quiet_NaN();
  parameter.known_to = {};  // as well as what it follows from
  parameter.lower = spec.lower;
  parameter.upper = spec.upper;
  ties.push_back({ref.index, std::move(law), spec, within(*word, 1), {}});
  return true;
}

std::pair<double, double> ConfigReader::span_of(ParameterRef ref) const {
  const Parameter& parameter = table[ref];
  if (parameter.free) return {parameter.lower, parameter.upper};
  if (const auto tied = tie_starts.find(parameter.name); tied != tie_starts.end())
    return {tied->second.low, tied->second.high};
  return {parameter.value, parameter.value};
}

std::optional<double> ConfigReader::value_of(const YamlNode& node, const std::string& name, const NumberSpec& spec) {
  const std::optional<double> value = finite(node, name);
  if (!value) return std::nullopt;
  if (!spec.contains(*value)) {
    problems.add(node.where, name + " = " + show(*value) + " is outside " + range_of(spec), unit_hint(*value, spec));
    return std::nullopt;
  }
  return value;
}

const ArrayImage* ConfigReader::image_in_memory(const std::filesystem::path& file) const {
  if (!in_memory) return nullptr;
  const auto found = in_memory->images.find(file.string());
  return found == in_memory->images.end() ? nullptr : &found->second;
}

const std::string* ConfigReader::field_in_memory(const std::filesystem::path& file) const {
  if (!in_memory) return nullptr;
  const auto found = in_memory->fields.find(file.string());
  return found == in_memory->fields.end() ? nullptr : found->second.get();
}

ParameterRef ConfigReader::constant(const std::string& path, const NumberSpec& spec, double value) {
  Parameter parameter;
  parameter.name = path;
  parameter.unit = spec.unit;
  parameter.value = value;
  parameter.linear = spec.linear;
  parameter.physical_lower = spec.physical_lower;
  parameter.physical_upper = spec.physical_upper;
  parameter.known_to = spec.known_to;
  parameter.where = {file};
  const ParameterRef ref = table.add(std::move(parameter));
  specs[path] = spec;
  refs[path] = ref;
  return ref;
}

ParameterRef ConfigReader::number(const Block& block, const std::string& key, const NumberSpec& spec,
                                  std::optional<double> fallback) {
  const std::string path = block.path_of(key);
  if (const YamlNode* node = block.find(key)) return number_at(*node, path, spec);
  if (!fallback && std::find(set_everywhere.begin(), set_everywhere.end(), path) == set_everywhere.end())
    missing(block, key);
  const ParameterRef ref = constant(path, spec, fallback.value_or(std::isfinite(spec.lower) ? spec.lower : 0));
  if (fallback) table[ref].known_to = {};  // what nobody has stated is the model's
  return ref;
}

ParameterRef ConfigReader::number_at(const YamlNode& node, const std::string& path, const NumberSpec& spec) {
  const std::string name = last_key(path);
  const ParameterRef ref = constant(path, spec, std::isfinite(spec.lower) ? spec.lower : 0);
  Parameter& parameter = table[ref];
  parameter.where = node.where;
  if (read_tie(node, name, spec, ref)) return ref;
  if (!node.is_map()) {
    if (const std::optional<double> value = value_of(node, name, spec)) parameter.value = *value;
    return ref;
  }
  if (spec.fixed) {
    problems.add(node.where, name + " is known, not fitted: it must be a plain number");
    return ref;
  }
  check_keys(node, path, {"value", "fit", "prior_sd", "exact"});
  const YamlNode* value_node = node.find("value");
  const YamlNode* fit_node = node.find("fit");
  const YamlNode* prior_node = node.find("prior_sd");
  const YamlNode* exact_node = node.find("exact");
  NumberSpec positive;
  positive.lower = 0;
  positive.lower_open = true;
  std::optional<double> value;
  if (value_node) value = value_of(*value_node, name, spec);
  if (value) parameter.value = *value;

  if (!fit_node) {
    if (exact_node && prior_node)
      problems.add(prior_node->where, name + " is exact and has a prior_sd", "give one of the two");
    const bool exact = exact_node && exact_node->is_scalar() && exact_node->text == "true";
    if (exact) parameter.known_to = {};
    if (exact_node && !exact && !(exact_node->is_scalar() && exact_node->text == "false"))
      problems.add(exact_node->where, name + ": exact must be true or false, found " + exact_node->describe());
    if (prior_node)
      if (const std::optional<double> sd = value_of(*prior_node, name + " prior_sd", positive))
        parameter.known_to = {*sd, 0};
    if (!value_node)
      problems.add(node.where, name + " needs a value", "write a number or {value: .., fit: [low, high]}");
    return ref;
  }
  if (exact_node && spec.linear && exact_node->is_scalar() && exact_node->text == "true")
    parameter.known_to = {};  // the same for all that share it
  else if (exact_node)
    problems.add(exact_node->where, name + " is fitted and exact", "give one of the two");
  parameter.free = true;
  const bool is_auto = fit_node->is_scalar() && fit_node->text == "auto";
  if (is_auto) {
    if (!spec.automatic)
      problems.add(fit_node->where, name + " cannot be fitted with fit: auto",
                   "only gain, offset, center_px and diameter_um can; write {value: .., fit: [low, high]}");
    parameter.automatic = true;
    // `value` beside `auto` stands; without it the value is found in the image.
    if (!value) parameter.value = std::numeric_limits<double>::quiet_NaN();
  } else if (!fit_node->is_sequence() || fit_node->items.size() != 2) {
    problems.add(
        fit_node->where,
        name + ": fit must be two bounds [low, high]" + (spec.automatic ? " or auto" : "") + ", found " +
            (fit_node->is_sequence() ? std::to_string(fit_node->items.size()) + " items" : fit_node->describe()));
  } else {
    if (!value_node) problems.add(node.where, name + " is fitted but has no start", "add value: .. inside the bounds");
    const std::optional<double> low = finite(fit_node->items[0], name + " fit bound");
    const std::optional<double> high = finite(fit_node->items[1], name + " fit bound");
    if (low && high) {
      NumberSpec closed = spec;  // a bound may touch an open end; the value may not
      closed.lower_open = closed.upper_open = false;
      if (*low >= *high) {
        problems.add(
            fit_node->where,
            name + ": fit bounds [" + show(*low) + ", " + show(*high) + "] are " +
                (*low > *high ? "reversed" : "equal"),
            *low > *high ? "did you mean [" + show(*high) + ", " + show(*low) + "]?" : "a known number needs no fit");
      } else {
        for (int i = 0; i < 2; ++i) {
          const double bound = i == 0 ? *low : *high;
          if (!closed.contains(bound))
            problems.add(fit_node->items[i].where,
                         name + " fit bound " + show(bound) + " is outside " + range_of(closed),
                         unit_hint(bound, closed));
        }
        if (value && (*value < *low || *value > *high))
          problems.add(
              value_node->where,
              name + " = " + show(*value) + " is outside its fit bounds [" + show(*low) + ", " + show(*high) + "]",
              "start inside them");
      }
      parameter.lower = *low;
      parameter.upper = *high;
    }
  }
  if (prior_node) {
    const std::optional<double> sd = value_of(*prior_node, name + " prior_sd", positive);
    if (!value_node) problems.add(prior_node->where, name + " has prior_sd but no value to centre it on");
    parameter.prior_sd = sd;
  }
  return ref;
}

std::optional<double> ConfigReader::plain(const Block& block, const std::string& key, const NumberSpec& spec) {
  const YamlNode* node = block.find(key);
  if (!node) return std::nullopt;
  if (node->is_map()) {
    problems.add(node->where, key + " must be a plain number: it cannot be fitted");
    return std::nullopt;
  }
  return value_of(*node, key, spec);
}

std::optional<int> ConfigReader::integer(const Block& block, const std::string& key, int lower, int upper) {
  const YamlNode* node = block.find(key);
  if (!node) return std::nullopt;
  NumberSpec spec;
  spec.lower = lower;
  spec.upper = upper;
  const std::optional<double> value = value_of(*node, key, spec);
  if (!value) return std::nullopt;
  if (*value != std::floor(*value)) {
    problems.add(node->where, key + " = " + show(*value) + " must be a whole number");
    return std::nullopt;
  }
  return static_cast<int>(*value);
}

std::optional<std::string> ConfigReader::text(const Block& block, const std::string& key) {
  const YamlNode* node = block.find(key);
  if (!node) return std::nullopt;
  if (!node->is_scalar() || node->text.empty()) {
    problems.add(node->where, key + " must be text, found " + node->describe());
    return std::nullopt;
  }
  return node->text;
}

std::optional<std::string> ConfigReader::choice(const Block& block, const std::string& key,
                                                const std::vector<std::string>& words) {
  const YamlNode* node = block.find(key);
  if (!node) return std::nullopt;
  if (node->is_scalar() && std::find(words.begin(), words.end(), node->text) != words.end()) return node->text;
  const std::string near = node->is_scalar() ? nearest_word(node->text, words) : "";
  problems.add(node->where, key + " must be one of " + list_words(words) + ", found " + node->describe(),
               near.empty() ? "" : "did you mean " + near + "?");
  return std::nullopt;
}

std::optional<std::vector<int>> ConfigReader::integers(const Block& block, const std::string& key, std::size_t count,
                                                       const std::string& shape) {
  const YamlNode* node = block.find(key);
  if (!node) return std::nullopt;
  if (!node->is_sequence() || node->items.size() != count) {
    problems.add(node->where,
                 key + " must be " + shape + ", found " +
                     (node->is_sequence() ? std::to_string(node->items.size()) + " items" : node->describe()));
    return std::nullopt;
  }
  std::vector<int> values;
  NumberSpec spec;
  spec.lower = -1e6;
  spec.upper = 1e6;
  for (const YamlNode& item : node->items) {
    const std::optional<double> value = value_of(item, key, spec);
    if (!value) return std::nullopt;
    if (*value != std::floor(*value)) {
      problems.add(item.where, key + ": " + show(*value) + " must be a whole number of pixels");
      return std::nullopt;
    }
    values.push_back(static_cast<int>(*value));
  }
  return values;
}

}  // namespace birefit
