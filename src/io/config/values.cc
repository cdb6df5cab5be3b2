#include "io/config/values.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "io/config/reader.h"
#include "io/report/format.h"
#include "io/results/picture.h"
#include "medium/references.h"

namespace birefit {

std::string path_named(const std::vector<std::string>& paths, const std::string& name, const Where& where) {
  std::vector<std::string> found, all;
  for (const std::string& path : paths) {
    if (path == name) return path;
    if (std::find(all.begin(), all.end(), path) != all.end()) continue;
    all.push_back(path);
    if (path.ends_with("." + name)) found.push_back(path);
  }
  if (found.size() == 1) return found[0];
  if (found.size() > 1)
    throw UserError(where, name + " may be " + list_words(found), "write so much of the path that one is left");
  std::vector<std::string> endings;
  for (const std::string& path : all) endings.push_back(short_name(path));
  const std::string near = nearest_word(name, endings);
  throw UserError(where, name + " is no parameter of this config",
                  near.empty() ? "known are " + list_words(all) : "did you mean " + near + "?");
}

ParameterRef parameter_named(const ParameterTable& table, const std::string& name, const Where& where) {
  std::vector<std::string> paths;
  for (int i = 0; i < table.size(); ++i) paths.push_back(table[i].name);
  return table.find(path_named(paths, name, where));
}

ValueRanges::ValueRanges(const Config& config) {
  const auto note = [&](const Scene& scene) {
    for_each_number(scene, [&](const ParameterRef& ref, const NumberSpec& spec) {
      if (ref) specs_.emplace(ref.index, spec);
    });
  };
  for (const Scene* scene : scenes_of(config)) note(*scene);
  for_each_scene(config.job.measurements, note);
}

void ValueRanges::check(const ParameterTable& table, int index, double value, const Where& where) const {
  const std::string name = short_name(table[index].name);
  if (!std::isfinite(value)) throw UserError(where, name + " = " + show(value) + " is no finite number");
  const auto found = specs_.find(index);
  if (found != specs_.end() && !found->second.contains(value))
    throw UserError(where, name + " = " + show(value) + " is outside " + range_of(found->second),
                    unit_hint(value, found->second));
}

}  // namespace birefit
