#include "io/config/ties.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "medium/references.h"

namespace birefit {
namespace {

/// Units by what names of numbers end in.
const std::vector<std::pair<const char*, const char*>> kEndings{
    {"_mm2_s", "mm2/s"}, {"_v_per_um", "V/um"}, {"_brewster", "brewster"},
    {"_mpa", "MPa"},     {"_deg", "deg"},       {"_rad", "rad"},
    {"_um", "um"},       {"_nm", "nm"},         {"_mm", "mm"},
    {"_cm", "cm"},       {"_px", "px"},         {"_pn", "pN"},
    {"_k", "K"},         {"_v", "V"},           {"_n", "N"},
    {"_s", "s"},         {"_kv", "kV"},         {"_mv", "mV"},
    {"_ms", "ms"},       {"_pa", "Pa"},         {"_um2", "um2"},
    {"_mm2", "mm2"}};

std::optional<std::string> unit_by_name(const std::string& name) {
  for (const auto& [ending, unit] : kEndings)
    if (name.ends_with(ending)) return unit;
  return std::nullopt;
}

/// "micrographs[1]." of a number that a picture has for itself, "signal[0].row[3]." of a row's; "" of shared ones.
std::string scope_of(const std::string& name) {
  if (!name.starts_with("micrographs[") && !name.starts_with("signal[")) return {};
  std::size_t end = name.find("].");
  if (end == std::string::npos) return {};
  if (name.compare(end + 2, 4, "row[") == 0) end = name.find("].", end + 2);
  return end == std::string::npos ? std::string() : name.substr(0, end + 2);
}

/// Names of a config's numbers and the entries that they stand for, tied ones with what they follow from.
class Binder {
 public:
  Binder(ConfigReader& reader, const std::vector<Scene*>& scenes) : reader_(reader), scenes_(scenes) {
    for (int i = 0; i < reader.table.size(); ++i) by_name_.emplace(reader.table[i].name, i);
    for (const auto& [path, ref] : reader.refs)
      if (reader.specs.contains(path)) shared_[path] = ref.index;
    for (TiedNumber& tie : reader.ties) tied_[tie.index] = &tie;
  }

  void look_up_all() {
    for (TiedNumber& tie : reader_.ties) {
      std::vector<int> of = look_up(*tie.law, tie.where, scope_of(reader_.table[tie.index].name), tie.index);
      if (of.size() != tie.law->names().size() || !settle(*tie.law, of, tie.spec.unit, tie.where)) continue;
      tie.of = std::move(of);
    }
    break_circles();
    for (std::size_t k = 0; k < reader_.ties.size(); ++k) {  // which grow
      const std::string scope = scope_of(reader_.table[reader_.ties[k].index].name);
      std::vector<int> of = reader_.ties[k].of;
      if (scope.empty()) continue;
      for (int& index : of)
        if (const int its = own(index, {scope}); its != reader_.ties[k].index) index = its;
      reader_.ties[k].of = std::move(of);
    }
  }

  /// What a scene reads and is tied to something that it has for itself becomes its own.
  void give_own() {
    for (Scene* scene : scenes_) {
      std::set<std::string> found;
      std::vector<ParameterRef> read;
      for_each_ref(*scene, [&](ParameterRef& ref) {
        if (!ref) return;
        if (const std::string scope = scope_of(reader_.table[ref].name); !scope.empty()) found.insert(scope);
        if (tied_.contains(ref.index)) read.push_back(ref);
      });
      std::vector<std::string> scopes(found.begin(), found.end());
      std::sort(scopes.begin(), scopes.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
      for (const ParameterRef ref : read)
        if (const int index = own(ref.index, scopes); index != ref.index) replace(*scene, ref, index);
    }
    for (const Scene* scene : scenes_)
      for_each_ref(*scene, [&](const ParameterRef& ref) {
        if (ref) use(ref.index);
      });
  }

  void tie_all() {
    break_circles();  // again, of what pictures have for themselves
    std::set<int> done;
    const std::function<void(int)> tie = [&](int index) {
      const auto found = tied_.find(index);
      // One of units alone ("5000 * nm") reads nothing, and is known.
      if (found == tied_.end() || !used_.contains(index) || !done.insert(index).second ||
          found->second->of.size() != found->second->law->names().size())
        return;
      for (const int of : found->second->of) tie(of);
      if (varies_by_picture(index, *found->second)) return;
      reader_.table.tie(index, {found->second->law, found->second->of});
    };
    for (const int index : std::set<int>(used_)) tie(index);
  }

  std::optional<Derived> derived(const Wanted& wanted) {
    std::vector<int> of = look_up(*wanted.law, wanted.where, "", -1, true);
    if (of.size() != wanted.law->names().size()) return std::nullopt;
    if (!settle(*wanted.law, of, std::nullopt, wanted.where)) return std::nullopt;
    // One letter is a unit only of what has one: delta_n, eps_s.
    const bool letter = wanted.name.size() > 1 && wanted.name[wanted.name.size() - 2] == '_';
    if (!(letter && wanted.law->unit().empty()) && !settle(*wanted.law, of, unit_by_name(wanted.name), wanted.where))
      return std::nullopt;
    for (const int index : of) use(index);
    return Derived{wanted.name, wanted.law->unit(), {wanted.law, std::move(of)}};
  }

  TieStarts starts() const {
    TieStarts starts;
    const Theta theta = reader_.table.values();
    // Of a shared number that only stands for those of pictures, the first of these.
    for (const bool used : {true, false})
      for (const auto& [index, tie] : tied_) {
        const std::string& name = reader_.table[index].name;
        // No key of the config is a row's.
        if (used_.contains(index) != used || starts.contains(name) || name.find("].row[") != std::string::npos)
          continue;
        int shown = index;
        for (const auto& [other, unused] : tied_)
          if (!used && used_.contains(other) && reader_.table[other].name.ends_with("." + name)) shown = other;
        if (!reader_.table.tie_of(shown)) continue;
        const auto [low, high] = reader_.table.reach(shown);
        starts[name] = {theta[static_cast<std::size_t>(shown)], low, high};
      }
    return starts;
  }

 private:
  void problem(const Where& where, int column, const std::string& what, const std::string& hint) {
    Where there = where;
    if (there.line > 0) there.column += column - 1;
    reader_.problems.add(there, what, hint);
  }

  bool settle(Expression& law, const std::vector<int>& of, const std::optional<std::string>& unit, const Where& where) {
    std::vector<std::string> units;
    for (const int index : of) units.push_back(reader_.table[index].unit);
    try {
      law.settle_units(units, unit);
      return true;
    } catch (const ExpressionError& error) {
      problem(where, error.column, error.wrong, error.hint);
      return false;
    }
  }

  /// Entries of all names; fewer where one is not known, which is then a problem. `tied`: whose expression it is.
  std::vector<int> look_up(const Expression& law, const Where& where, const std::string& scope, int tied,
                           bool report = false) {
    std::vector<int> of;
    for (const Expression::Name& name : law.names()) {
      const std::optional<int> index = find(name, where, scope, tied);
      if (!index) continue;
      if (!report && reader_.table[*index].linear) {
        problem(where, name.column, name.text + " is solved for once all else is known: nothing can be tied to it", "");
        continue;
      }
      const std::optional<int> shown = report ? as_reported(*index, name, where) : index;
      if (shown) of.push_back(*shown);
    }
    return of;
  }

  std::optional<int> find(const Expression::Name& name, const Where& where, const std::string& scope, int tied) {
    if (!scope_of(name.text).empty())
      if (const auto exact = by_name_.find(name.text); exact != by_name_.end()) return exact->second;
    std::vector<std::string> ends, known;
    for (const auto& [path, index] : shared_) {
      known.push_back(path);
      if (path == name.text) ends.assign(1, path);
      if (path == name.text) break;
      if (path.ends_with("." + name.text)) ends.push_back(path);
    }
    if (ends.size() == 1) {
      const auto own = by_name_.find(scope + ends[0]);
      // A picture's own number may follow from the shared one of its name.
      return own != by_name_.end() && own->second != tied ? own->second : shared_.at(ends[0]);
    }
    if (ends.size() > 1) {
      problem(where, name.column, name.text + " is the end of several names: " + list_words(ends),
              "give more of the path");
      return std::nullopt;
    }
    const std::string near = nearest_word(name.text, known);
    problem(where, name.column, name.text + " is no parameter of this config",
            !near.empty() ? "did you mean " + near + "?" : "known here: " + list_words(known));
    return std::nullopt;
  }

  /// What a report means by a shared number that pictures have each for themselves: the one picture's.
  std::optional<int> as_reported(int index, const Expression::Name& name, const Where& where) {
    const std::string& path = reader_.table[index].name;
    if (used_.contains(index) || !scope_of(path).empty()) return index;
    std::vector<std::string> own;
    for (const auto& [other, unused] : by_name_)
      if (const std::string scope = scope_of(other); !scope.empty() && other == scope + path) own.push_back(other);
    if (own.empty()) return index;
    if (own.size() == 1) return by_name_.at(own[0]);
    problem(where, name.column, name.text + " differs from picture to picture", "name one: " + own[0]);
    return std::nullopt;
  }

  void break_circles() {
    std::map<int, int> state;  // 1: on the way, 2: done
    std::vector<int> way;
    const std::function<void(int)> visit = [&](int index) {
      const auto found = tied_.find(index);
      if (found == tied_.end() || state[index] == 2) return;
      if (state[index] == 1) {
        std::string circle;
        for (auto at = std::find(way.begin(), way.end(), index); at != way.end(); ++at)
          circle += reader_.table[*at].name + " from ";
        reader_.problems.add(found->second->where, "tied in a circle: " + circle + reader_.table[index].name,
                             "give one of them as a number");
        found->second->of.clear();
        return;
      }
      state[index] = 1;
      way.push_back(index);
      for (const int of : std::vector<int>(found->second->of)) visit(of);
      way.pop_back();
      state[index] = 2;
    };
    for (const TiedNumber& tie : reader_.ties) visit(tie.index);
  }

  /// The entry that a scene with numbers of its own under these names has in place of this one, which is shared or of a
  /// wider name: a table's own number may follow from its rows'.
  int own(int index, const std::vector<std::string>& scopes) {
    const std::string from = scope_of(reader_.table[index].name), name = reader_.table[index].name.substr(from.size());
    for (const std::string& scope : scopes)
      if (const auto found = by_name_.find(scope + name); scope.size() > from.size() && found != by_name_.end())
        return found->second;
    const bool narrower =
        std::any_of(scopes.begin(), scopes.end(), [&](const auto& scope) { return scope.size() > from.size(); });
    const auto tie = tied_.find(index);
    // A circle of numbers of one's own is named once all are there (tie_all).
    if (!narrower || tie == tied_.end() || tie->second->of.empty() || !asked_.insert(index).second) return index;
    TiedNumber copy = *tie->second;
    std::string scope = from;  // the narrowest that makes a difference
    for (int& of : copy.of) {
      const int there = own(of, scopes);
      if (there == of) continue;
      of = there;
      if (const std::string its = scope_of(reader_.table[there].name); its.size() > scope.size()) scope = its;
    }
    asked_.erase(index);
    if (scope == from) return index;
    Parameter parameter = reader_.table[index];
    parameter.name = scope + name;
    copy.index = reader_.table.add(parameter).index;
    by_name_[parameter.name] = copy.index;
    reader_.replaced.insert(index);
    reader_.ties.push_back(std::move(copy));
    tied_.clear();  // they may have moved
    for (TiedNumber& one : reader_.ties) tied_[one.index] = &one;
    return by_name_.at(parameter.name);
  }

  void replace(Scene& scene, ParameterRef from, int to) {
    for_each_ref(scene, [&](ParameterRef& ref) {
      if (ref == from) ref.index = to;
    });
  }

  void use(int index) {
    if (!used_.insert(index).second) return;
    if (const auto tie = tied_.find(index); tie != tied_.end())
      for (const int of : tie->second->of) use(of);
  }

  /// A number that every picture sets for itself, and the shared blocks do not give, has no value for others to follow.
  bool varies_by_picture(int index, const TiedNumber& tie) {
    for (std::size_t k = 0; k < tie.of.size(); ++k) {
      const std::string& name = reader_.table[tie.of[k]].name;
      const auto& everywhere = reader_.set_everywhere;
      const Where& given = reader_.table[tie.of[k]].where;
      if (given.line > 0 || given.file != reader_.file) continue;  // as well
      if (std::find(everywhere.begin(), everywhere.end(), name) == everywhere.end()) continue;
      problem(tie.where, tie.law->names()[k].column,
              name + " differs from picture to picture, and " + reader_.table[index].name + " does not",
              "name one, as micrographs[0]." + name + " is");
      return true;
    }
    return false;
  }

  ConfigReader& reader_;
  const std::vector<Scene*>& scenes_;
  std::map<std::string, int> by_name_;  ///< all entries
  std::map<std::string, int> shared_;   ///< what may be named without a picture
  std::map<int, TiedNumber*> tied_;
  std::set<int> used_;
  std::set<int> asked_;  ///< on the way to what own() is asked for
};

}  // namespace

std::vector<Wanted> read_report(ConfigReader& reader, const Block& root) {
  std::vector<Wanted> wanted;
  const YamlNode* block = root.find("report");
  if (!block) return wanted;
  if (!block->is_map()) {
    reader.problems.add(block->where, "report must be a map of names and expressions, found " + block->describe(),
                        "report: {elastic_ratio: \"freedericksz.k33_pn / freedericksz.k11_pn\"}");
    return wanted;
  }
  for (const YamlEntry& entry : block->entries) {
    const bool named = !entry.key.empty() && std::isalpha(static_cast<unsigned char>(entry.key[0])) &&
                       std::all_of(entry.key.begin(), entry.key.end(),
                                   [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; });
    if (!named) {
      reader.problems.add(entry.where, "a name in report has letters, digits and _ only, and begins with a letter");
      continue;
    }
    if (!entry.value.is_scalar()) {
      reader.problems.add(entry.value.where,
                          "report." + entry.key + " must be an expression, found " + entry.value.describe());
      continue;
    }
    try {
      wanted.push_back({entry.key, std::make_shared<Expression>(entry.value.text), within(entry.value, 1)});
    } catch (const ExpressionError& error) {
      reader.problems.add(within(entry.value, error.column), "report." + entry.key + ": " + error.wrong, error.hint);
    }
  }
  return wanted;
}

TieStarts bind_ties(ConfigReader& reader, const std::vector<Scene*>& scenes, const std::vector<Wanted>& wanted,
                    std::vector<Derived>& derived) {
  Binder binder(reader, scenes);
  binder.look_up_all();
  binder.give_own();
  for (const Wanted& one : wanted)
    if (std::optional<Derived> found = binder.derived(one)) derived.push_back(std::move(*found));
  binder.tie_all();
  refresh_ties(reader);
  return binder.starts();
}

void refresh_ties(ConfigReader& reader) {
  const Theta theta = reader.table.values();
  for (const int index : reader.table.tied()) reader.table[index].value = theta[static_cast<std::size_t>(index)];
}

void check_ties(ConfigReader& reader) {
  refresh_ties(reader);
  const Theta theta = reader.table.values();
  for (const TiedNumber& tie : reader.ties) {
    const Tie* known = reader.table.tie_of(tie.index);
    if (!known) continue;
    const double value = reader.table.value_of(*known, theta);
    const bool waits = std::any_of(known->of.begin(), known->of.end(), [&](int of) {
      return std::isnan(theta[static_cast<std::size_t>(of)]);  // no picture has been looked at
    });
    if (waits || (std::isfinite(value) && tie.spec.contains(value))) continue;
    const std::string& name = reader.table[tie.index].name;
    const std::string unit = tie.spec.unit.empty() ? "" : " " + tie.spec.unit;
    if (std::isfinite(value))
      reader.problems.add(tie.where, fmt::format("{} = {} is {}{} at the start, outside {}", name, tie.law->text(),
                                                 show(value), unit, range_of(tie.spec)));
    else
      reader.problems.add(tie.where, fmt::format("{} = {} is no number at the start", name, tie.law->text()),
                          "a root or logarithm of what is negative, or a division by zero");
  }
}

}  // namespace birefit
