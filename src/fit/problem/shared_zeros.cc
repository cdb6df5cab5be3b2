#include "fit/problem/shared_zeros.h"

#include <algorithm>
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

/// What scenes state of it: what is tied follows other dials.
template <class Ref>
std::vector<Ref*> stated_of(const FitJob& job, std::vector<Ref*> number) {
  std::erase_if(number, [&](const Ref* ref) { return job.parameters.tie_of(ref->index) != nullptr; });
  return number;
}

/// Stated by every scene that does not tie it, not by all the same one, and known within a standard deviation.
template <class Ref>
bool is_own_dial(const FitJob& job, const std::vector<Ref*>& number) {
  if (number.empty()) return false;
  const bool own =
      std::any_of(number.begin(), number.end(), [&](const Ref* ref) { return ref->index != number.front()->index; });
  return own && std::all_of(number.begin(), number.end(), [&](const Ref* ref) {
           return *ref && !job.parameters[*ref].free && !job.parameters[*ref].linear &&
                  job.parameters[*ref].known_to.sd > 0;
         });
}

/// Stated by every row for itself, and known to a share.
template <class Ref>
bool is_own_scale(const FitJob& job, const std::vector<Ref*>& number) {
  if (number.empty()) return false;
  return std::all_of(number.begin(), number.end(), [&](const Ref* ref) {
    if (!*ref) return false;
    const Parameter& stated = job.parameters[*ref];
    return !stated.free && !stated.linear && stated.known_to.sd == 0 && stated.known_to.share > 0 &&
           stated.name.find("].row[") != std::string::npos;
  });
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

/// Of "signal[1].row[3].sample.temperature_k" what follows the frame.
std::string path_in_frame(const std::string& name) {
  const std::size_t frame = name.rfind("].");
  return frame == std::string::npos ? name : name.substr(frame + 2);
}

}  // namespace

bool has_own_dials(const FitJob& job) {
  const auto numbers = numbers_in<const FitJob, const ParameterRef>(job);
  return std::any_of(numbers.begin(), numbers.end(), [&](const auto& number) {
    return is_own_dial(job, stated_of(job, number)) || is_own_scale(job, stated_of(job, number));
  });
}

FitJob with_shared_zeros(FitJob job) {
  const std::set<int> followed_by_others = followed(job);
  for (const std::vector<ParameterRef*>& all : numbers_in<FitJob, ParameterRef>(job)) {
    const std::vector<ParameterRef*> number = stated_of(job, all);
    const bool scale = is_own_scale(job, number);
    if (!scale && !is_own_dial(job, number)) continue;
    const Parameter first = job.parameters[*number.front()];
    const std::string path = path_in_frame(first.name);
    const ParameterRef common = scale ? job.parameters.add_constant("scale of " + path, 1, "")
                                      : job.parameters.add_constant("zero of " + path, 0, first.unit);
    double& sd = job.parameters[common].known_to.sd;
    for (const ParameterRef* ref : number) {
      const Uncertainty& known_to = job.parameters[*ref].known_to;
      sd = std::max(sd, scale ? known_to.share : known_to.sd);
    }
    for (ParameterRef* ref : number) {
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
  return job;
}

}  // namespace birefit::estimation
