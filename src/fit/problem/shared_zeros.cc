#include "fit/problem/shared_zeros.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "birefit/expression.h"
#include "medium/references.h"

namespace birefit::estimation {
namespace {

/// The same number of every scene; empty where scenes are not alike.
template <class Job, class Ref>
std::vector<std::vector<Ref*>> numbers_in(Job& job) {
  std::vector<std::vector<Ref*>> numbers;
  bool first = true, alike = true;
  for_each_scene(job.measurements, [&](auto& scene) {
    std::size_t k = 0;
    for_each_ref(scene, [&](Ref& ref) {
      if (first) numbers.emplace_back();
      if (k < numbers.size()) numbers[k].push_back(&ref);
      ++k;
    });
    alike = alike && k == numbers.size();
    first = false;
  });
  if (!alike) numbers.clear();
  return numbers;
}

/// Of "signal[1].row[3].sample.temperature_k" what follows the frame.
std::string path_in_frame(const std::string& name) {
  const std::size_t frame = name.rfind("].");
  return frame == std::string::npos ? name : name.substr(frame + 2);
}
/// Pictures at several wavelengths have a filter each; rows of a spectrum are read off one scale.
bool is_of_light(const Parameter& stated) {
  const std::string path = path_in_frame(stated.name);
  return path.ends_with("wavelength_nm") || path.ends_with("centre_nm") || path.ends_with("fwhm_nm");
}

/// Those places of one number that frames state each for itself and that have something in common.
template <class Ref>
struct Shared {
  std::vector<Ref*> dial;   ///< known within a standard deviation: one zero
  std::vector<Ref*> scale;  ///< known to a share of them: one scale
  std::vector<Ref*> equal;  ///< filters, which are one where their values are
};
template <class Ref>
Shared<Ref> shared_of(const FitJob& job, const std::vector<Ref*>& number) {
  const auto own = [](const std::vector<Ref*>& some) {
    return std::any_of(some.begin(), some.end(), [&](const Ref* ref) { return ref->index != some.front()->index; });
  };
  Shared<Ref> shared;
  bool of_row = false;
  for (Ref* ref : number) {
    // What is tied follows other dials.
    if (!*ref || job.parameters.tie_of(ref->index)) continue;
    const Parameter& stated = job.parameters[*ref];
    if (stated.free || stated.linear) continue;
    if (stated.known_to.sd > 0)
      shared.dial.push_back(ref);
    else if (stated.known_to.share > 0 && is_of_light(stated) && !is_of_row(stated))
      shared.equal.push_back(ref);
    else if (stated.known_to.share > 0)
      shared.scale.push_back(ref), of_row = of_row || is_of_row(stated);
  }
  if (!own(shared.dial)) shared.dial.clear();
  if (!of_row && !own(shared.scale)) shared.scale.clear();
  std::map<double, int> filters;
  const bool twice = std::any_of(shared.equal.begin(), shared.equal.end(), [&](const Ref* ref) {
    return filters.emplace(job.parameters[*ref].value, ref->index).first->second != ref->index;
  });
  if (!twice) shared.equal.clear();
  return shared;
}

/// What other numbers follow from.
std::set<int> followed(const FitJob& job) {
  std::set<int> all;
  for (const int tied : job.parameters.tied())
    for (const int root : job.parameters.roots(tied)) all.insert(root);
  for (const Derived& derived : job.derived)
    for (const int of : derived.tie.of)
      for (const int root : job.parameters.roots(of)) all.insert(root);
  return all;
}

/// The entry is from now on what it was stated to be and the zero, or times the scale, so that what follows from it
/// follows that, too.
void tie_to(ParameterTable& table, int index, ParameterRef common, const char* by) {
  Parameter& stated = table[index];
  stated.known_to = {};
  const std::string unit = stated.unit;
  const ParameterRef constant = table.add_constant("stated " + stated.name, stated.value, unit);
  auto law = std::make_shared<Expression>(by);
  law->settle_units({table[common].unit, unit}, unit);
  table.tie(index, {std::move(law), {common.index, constant.index}});
}

/// From now on what was stated and the zero, or times the scale.
void follow(FitJob& job, const std::vector<ParameterRef*>& places, bool scale,
            const std::set<int>& followed_by_others) {
  if (places.empty()) return;
  const Parameter first = job.parameters[*places.front()];
  const std::string path = path_in_frame(first.name);
  const ParameterRef common = scale ? job.parameters.add_constant("scale of " + path, 1, "")
                                    : job.parameters.add_constant("zero of " + path, 0, first.unit);
  double sd = 0;
  for (const ParameterRef* ref : places) {
    const Uncertainty& known_to = job.parameters[*ref].known_to;
    sd = std::max(sd, scale ? known_to.share : known_to.sd);
  }
  job.parameters[common].known_to.sd = sd;
  for (ParameterRef* ref : places) {
    if (followed_by_others.contains(ref->index)) {
      if (!job.parameters.tie_of(ref->index)) tie_to(job.parameters, ref->index, common, scale ? kByScale : kByZero);
      continue;
    }
    ParameterRef moved = *ref;
    const double stated = job.parameters[*ref].value;
    if (scale)
      moved.times *= stated;
    else
      moved.plus += moved.times * stated;
    moved.index = common.index;
    *ref = moved;
  }
}

/// One filter is one number.
void unite(const FitJob& job, const std::vector<ParameterRef*>& places, const std::set<int>& followed_by_others) {
  std::map<double, int> by_value;
  for (ParameterRef* ref : places) {
    if (followed_by_others.contains(ref->index)) continue;
    ref->index = by_value.emplace(job.parameters[*ref].value, ref->index).first->second;
  }
}

}  // namespace

bool is_of_row(const Parameter& stated) { return stated.name.find("].row[") != std::string::npos; }

bool has_own_dials(const FitJob& job) {
  const auto numbers = numbers_in<const FitJob, const ParameterRef>(job);
  return std::any_of(numbers.begin(), numbers.end(), [&](const auto& number) {
    const auto shared = shared_of(job, number);
    return !shared.dial.empty() || !shared.scale.empty() || !shared.equal.empty();
  });
}

FitJob with_shared_zeros(FitJob job) {
  const std::set<int> followed_by_others = followed(job);
  for (const std::vector<ParameterRef*>& number : numbers_in<FitJob, ParameterRef>(job)) {
    const Shared<ParameterRef> shared = shared_of(job, number);
    follow(job, shared.dial, false, followed_by_others);
    follow(job, shared.scale, true, followed_by_others);
    unite(job, shared.equal, followed_by_others);
  }
  return job;
}

}  // namespace birefit::estimation
