#include "io/config/yaml.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <cctype>
#include <sstream>

#include "core/printable.h"

namespace birefit {
namespace {

/// Throws at the first byte that is no UTF-8 text. yaml-cpp would guess an encoding or replace such bytes silently.
void check_text(const std::string& text, const std::string& file) {
  int line = 1, column = 1;
  for (std::size_t i = 0; i < text.size();) {
    const int length = utf8_length(text, i);
    const auto first = static_cast<unsigned char>(text[i]);
    if (length == 0) throw UserError({file, line, column}, "is not UTF-8 text", "is this a config file?");
    if (first < 0x20 && first != '\t' && first != '\n' && first != '\r')
      throw UserError({file, line, column}, "is not a text file (a control character)", "is this a config file?");
    if (first == '\n') {
      ++line;
      column = 1;
    } else {
      ++column;
    }
    i += static_cast<std::size_t>(length);
  }
}

[[noreturn]] void throw_too_deep(const Where& where) {
  throw UserError(where, "is nested deeper than " + std::to_string(kMaxYamlDepth) + " levels");
}

/// A tab where a line's indentation may still go on; blank lines and comments may have any.
void refuse_tab(const std::string& text, std::size_t at, std::size_t line_end, const Where& where) {
  const std::size_t first = text.find_first_not_of(" \t\r", at);
  if (first == std::string::npos || first >= line_end || text[first] == '#') return;
  throw UserError(where, "is indented with a tab", "YAML takes spaces only: two for each level");
}

/// Bounds the nesting before the recursive parser sees the text. An upper bound of the true depth: open brackets
/// outside quotes and comments, and the stack of indentations including those made by "- - - x" in one line.
void check_depth(const std::string& text, const std::string& file) {
  std::vector<int> indents;
  int brackets = 0, line = 1;
  char quote = 0;
  std::size_t line_start = 0;
  while (line_start <= text.size()) {
    std::size_t line_end = text.find('\n', line_start);
    if (line_end == std::string::npos) line_end = text.size();
    std::size_t i = line_start;
    if (brackets == 0 && !quote) {
      for (;;) {
        while (i < line_end && text[i] == ' ') ++i;
        if (i < line_end && text[i] == '\t') refuse_tab(text, i, line_end, {file, line, int(i - line_start) + 1});
        if (i >= line_end || text[i] == '#' || text[i] == '\r') break;
        const int column = static_cast<int>(i - line_start);
        while (!indents.empty() && indents.back() >= column) indents.pop_back();
        indents.push_back(column);
        if (static_cast<int>(indents.size()) > kMaxYamlDepth) throw_too_deep({file, line, column + 1});
        const bool indicator =
            (text[i] == '-' || text[i] == '?' || text[i] == ':') && i + 1 < line_end && text[i + 1] == ' ';
        if (!indicator) break;
        ++i;
      }
    }
    char previous = 0;  // the last character that is not a space: a quote opens only where a value can begin
    for (; i < line_end; ++i) {
      const char c = text[i];
      if (quote) {
        if (quote == '"' && c == '\\')
          ++i;
        else if (c == quote)
          quote = 0;
        previous = c;
        continue;
      }
      if (c == '#' && (i == line_start || text[i - 1] == ' ' || text[i - 1] == '\t')) break;
      if ((c == '"' || c == '\'') && (previous == 0 || previous == ':' || previous == ',' || previous == '[' ||
                                      previous == '{' || previous == '-' || previous == '?')) {
        quote = c;
      } else if (c == '[' || c == '{') {
        if (++brackets > kMaxYamlDepth) throw_too_deep({file, line, static_cast<int>(i - line_start) + 1});
      } else if ((c == ']' || c == '}') && brackets > 0) {
        --brackets;
      }
      if (c != ' ') previous = c;
    }
    line_start = line_end + 1;
    ++line;
  }
}

bool is_digits(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

/// "1 2": two numbers between which a comma was forgotten.
bool is_two_numbers(const std::string& text) {
  return text.find(' ') != std::string::npos && text.find_first_not_of("0123456789+-.eE ") == std::string::npos;
}

class TreeBuilder : public YAML::EventHandler {
 public:
  TreeBuilder(const std::string& file, Problems& problems) : file_(file), problems_(problems) {}

  YamlNode root;
  int documents = 0;
  Where second_document;

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents == 2) second_document = where(mark);
  }
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { leaf(mark, YamlNode::Kind::null, {}, false); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    throw UserError(where(mark), "aliases are not supported", "write the value out where it is used");
  }
  void OnAnchor(const YAML::Mark& mark, const std::string& name) override {
    throw UserError(where(mark), "anchors and aliases are not supported: &" + name,
                    "write the value out where it is used");
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t, const std::string& value) override {
    check_tag(mark, tag);
    if (tag != "!" && !stack_.empty() && stack_.back().node.is_sequence() && is_two_numbers(value))
      throw UserError(where(mark), "a comma is missing in the list: " + value,
                      "[" + value.substr(0, value.find(' ')) + ", ..]");
    leaf(mark, YamlNode::Kind::scalar, value, tag == "!");
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    check_tag(mark, tag);
    open(mark, YamlNode::Kind::sequence);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t, YAML::EmitterStyle::value) override {
    check_tag(mark, tag);
    open(mark, YamlNode::Kind::map);
  }
  void OnMapEnd() override { close(); }

 private:
  struct Frame {
    YamlNode node;
    bool has_key = false;
    std::string key;
    Where key_where;
  };

  Where where(const YAML::Mark& mark) const {
    if (mark.is_null()) return {file_};
    return {file_, mark.line + 1, mark.column + 1};
  }

  void check_tag(const YAML::Mark& mark, const std::string& tag) const {
    if (!tag.empty() && tag != "?" && tag != "!")
      throw UserError(where(mark), "YAML tags are not supported: " + tag, "write the plain value");
  }

  /// {b:1} is a key "b:1" and {value: 9,5} one "5", each without a value.
  void check_lone_key(const Frame& parent) const {
    const std::size_t colon = parent.key.find(':');
    if (colon != std::string::npos && colon > 0 && colon + 1 < parent.key.size())
      throw UserError(parent.key_where, "a space is missing behind the colon: " + parent.key,
                      parent.key.substr(0, colon) + ": " + parent.key.substr(colon + 1));
    if (is_digits(parent.key) && !parent.node.entries.empty())
      throw UserError(parent.key_where, "found a number alone between commas: " + parent.key,
                      "decimals have a point: 9.5, not 9,5");
  }

  void open(const YAML::Mark& mark, YamlNode::Kind kind) {
    if (!stack_.empty() && stack_.back().node.is_map() && !stack_.back().has_key)
      throw UserError(where(mark), "a key must be a plain word, not a list or a map");
    if (static_cast<int>(stack_.size()) >= kMaxYamlDepth) throw_too_deep(where(mark));
    Frame frame;
    frame.node.kind = kind;
    frame.node.where = where(mark);
    stack_.push_back(std::move(frame));
  }

  void close() {
    YamlNode node = std::move(stack_.back().node);
    stack_.pop_back();
    place(std::move(node));
  }

  void leaf(const YAML::Mark& mark, YamlNode::Kind kind, std::string text, bool quoted) {
    if (!stack_.empty() && stack_.back().node.is_map() && !stack_.back().has_key) {
      if (kind == YamlNode::Kind::null) throw UserError(where(mark), "a key is empty");
      stack_.back().has_key = true;
      stack_.back().key = std::move(text);
      stack_.back().key_where = where(mark);
      return;
    }
    YamlNode node;
    node.kind = kind;
    node.where = where(mark);
    node.text = std::move(text);
    node.quoted = quoted;
    place(std::move(node));
  }

  void place(YamlNode node) {
    if (stack_.empty()) {
      if (documents <= 1) root = std::move(node);
      return;
    }
    Frame& parent = stack_.back();
    if (parent.node.is_sequence()) {
      parent.node.items.push_back(std::move(node));
      return;
    }
    parent.has_key = false;
    if (node.kind == YamlNode::Kind::null) check_lone_key(parent);
    for (const YamlEntry& entry : parent.node.entries) {
      if (entry.key != parent.key) continue;
      problems_.add(parent.key_where, "duplicate key " + parent.key,
                    "first given at line " + std::to_string(entry.where.line) + "; keep one of the two");
      return;
    }
    // The value of "key:" with nothing behind it has no useful place of its own.
    if (node.kind == YamlNode::Kind::null) node.where = parent.key_where;
    parent.node.entries.push_back({parent.key, parent.key_where, std::move(node)});
  }

  std::string file_;
  Problems& problems_;
  std::vector<Frame> stack_;
};

}  // namespace

const YamlNode* YamlNode::find(const std::string& key) const {
  for (const YamlEntry& entry : entries)
    if (entry.key == key) return &entry.value;
  return nullptr;
}

std::string YamlNode::describe() const {
  switch (kind) {
    case Kind::null:
      return "nothing";
    case Kind::sequence:
      return "a list";
    case Kind::map:
      return "a map";
    case Kind::scalar:
      break;
  }
  const std::string shown = text.size() > 40 ? text.substr(0, 37) + "..." : text;
  return quoted ? "the text \"" + shown + "\"" : shown;
}

namespace {

/// A bracket that is open where the parser gave up.
struct OpenBracket {
  char bracket = 0;
  int line = 0, column = 0;
};
std::vector<OpenBracket> open_brackets(const std::string& text, std::size_t end) {
  std::vector<OpenBracket> open;
  char quote = 0, previous = '\n';
  int line = 1;
  std::size_t line_start = 0;
  for (std::size_t i = 0; i < std::min(end, text.size()); ++i) {
    const char c = text[i];
    if (c == '\n') {
      ++line;
      line_start = i + 1;
    } else if (quote) {
      if (c == quote) quote = 0;
    } else if (c == '#' && (previous == ' ' || previous == '\t' || previous == '\n')) {
      while (i + 1 < text.size() && text[i + 1] != '\n') ++i;
    } else if ((c == '"' || c == '\'') && !std::isalnum(static_cast<unsigned char>(previous))) {
      quote = c;
    } else if (c == '{' || c == '[') {
      open.push_back({c, line, static_cast<int>(i - line_start) + 1});
    } else if ((c == '}' || c == ']') && !open.empty()) {
      open.pop_back();
    }
    previous = c;
  }
  return open;
}

/// What yaml-cpp's words mean for someone who wrote a config.
[[noreturn]] void explain_syntax(const std::string& text, const std::string& file, const YAML::Exception& error) {
  if (error.mark.is_null()) throw UserError({file}, "YAML syntax error: " + error.msg);
  const Where where{file, error.mark.line + 1, error.mark.column + 1};
  std::size_t start = 0;
  for (int line = 0; line < error.mark.line && start != std::string::npos; ++line) {
    start = text.find('\n', start);
    if (start != std::string::npos) ++start;
  }
  if (start == std::string::npos) throw UserError(where, "YAML syntax error: " + error.msg);
  const std::size_t at = std::min(start + static_cast<std::size_t>(error.mark.column), text.size());
  const std::string line = text.substr(start, text.find_first_of("\r\n", start) - start);
  // The mark may stand on the bracket that does not fit, or just before what came instead of one.
  const std::vector<OpenBracket> open = open_brackets(text, at);
  if (!open.empty()) {
    const OpenBracket& last = open.back();
    const std::string close = last.bracket == '{' ? "}" : "]";
    throw UserError(where,
                    std::string("YAML syntax error in the ") + last.bracket + " that opens at " +
                        std::to_string(last.line) + ":" + std::to_string(last.column),
                    "a comma is missing before this, or the closing " + close);
  }
  if (line.find_first_of("}]") < static_cast<std::size_t>(error.mark.column) + 1)
    throw UserError(where, "YAML syntax error: something stands behind a closing bracket",
                    "one bracket too many, or a line end is missing");
  const std::size_t first = line.find(": ");
  if (first != std::string::npos && line.find(": ", first + 2) != std::string::npos)
    throw UserError(where, "YAML syntax error: two keys in one line",
                    "pairs in one line stand in braces, {a: 1, b: 2}; text with a colon in quotes");
  throw UserError(where, "YAML syntax error: " + error.msg,
                  "keys of one block start in the same column, and a space follows each colon");
}

}  // namespace

YamlNode parse_yaml(const std::string& text, const std::string& file, Problems& problems) {
  check_text(text, file);
  check_depth(text, file);
  TreeBuilder builder(file, problems);
  std::istringstream stream(text);
  try {
    YAML::Parser parser(stream);
    while (builder.documents < 2 && parser.HandleNextDocument(builder)) {
    }
  } catch (const YAML::Exception& error) {
    explain_syntax(text, file, error);
  }
  if (builder.documents > 1)
    throw UserError(builder.second_document, "a second YAML document starts here", "a config is one document");
  if (builder.documents == 0 || builder.root.kind == YamlNode::Kind::null)
    throw UserError({file}, "is empty", "`birefit new droplet` prints a config to start from");
  if (!builder.root.is_map())
    throw UserError(builder.root.where, "expected `key: value` lines, found " + builder.root.describe(),
                    builder.root.text.find(':') == std::string::npos ? "" : "a space follows each colon");
  return std::move(builder.root);
}

int edit_distance(const std::string& a, const std::string& b) {
  const int n = static_cast<int>(a.size()), m = static_cast<int>(b.size());
  std::vector<std::vector<int>> d(n + 1, std::vector<int>(m + 1));
  for (int i = 0; i <= n; ++i) d[i][0] = i;
  for (int j = 0; j <= m; ++j) d[0][j] = j;
  for (int i = 1; i <= n; ++i) {
    for (int j = 1; j <= m; ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[n][m];
}

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  // The distance takes the product of the lengths, and no word of a config is as long as this.
  constexpr std::size_t kLongest = 100;
  if (word.size() > kLongest) return {};
  std::string best;
  int best_distance = 1 << 20;
  for (const std::string& candidate : known) {
    if (candidate.size() > kLongest) continue;
    int distance = edit_distance(word, candidate);
    // A forgotten or wrong unit ("diameter", "diameter_nm" for diameter_um) is far in letters but near in meaning.
    const std::string stem = candidate.substr(0, candidate.rfind('_'));
    if (stem.size() >= 4 && stem != candidate && (word == stem || word.substr(0, word.rfind('_')) == stem))
      distance = std::min(distance, 1);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  const int longest = static_cast<int>(std::max(word.size(), best.size()));
  return best_distance <= std::max(1, longest * 2 / 5) && best_distance < static_cast<int>(word.size()) ? best : "";
}

}  // namespace birefit
