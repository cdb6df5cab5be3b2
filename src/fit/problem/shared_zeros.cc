#include "fit/problem/shared_zeros.h"

#include <algorithm>
#include <string>
#include <vector>

#include "medium/references.h"

namespace birefit::estimation {
namespace {

/// The same number of every scene; empty where scenes are not alike.
template <class Job, class Ref>
std::vector<std::vector<Ref*>> numbers_of(Job& job) {
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

/// Stated by every scene, not by all the same one, and known within a standard deviation.
template <class Ref>
bool is_own_dial(const FitJob& job, const std::vector<Ref*>& number) {
  const bool own =
      std::any_of(number.begin(), number.end(), [&](const Ref* ref) { return ref->index != number.front()->index; });
  return own && std::all_of(number.begin(), number.end(), [&](const Ref* ref) {
           return *ref && !job.parameters[*ref].free && !job.parameters[*ref].linear &&
                  job.parameters[*ref].known_to.sd > 0;
         });
}

/// Of "signal[1].row[3].sample.temperature_k" what follows the frame.
std::string path_in_frame(const std::string& name) {
  const std::size_t frame = name.rfind("].");
  return frame == std::string::npos ? name : name.substr(frame + 2);
}

}  // namespace

bool has_own_dials(const FitJob& job) {
  const auto numbers = numbers_of<const FitJob, const ParameterRef>(job);
  return std::any_of(numbers.begin(), numbers.end(), [&](const auto& number) { return is_own_dial(job, number); });
}

FitJob with_shared_zeros(FitJob job) {
  for (const std::vector<ParameterRef*>& number : numbers_of<FitJob, ParameterRef>(job)) {
    if (!is_own_dial(job, number)) continue;
    const Parameter first = job.parameters[*number.front()];
    const ParameterRef zero = job.parameters.add_constant("zero of " + path_in_frame(first.name), 0, first.unit);
    for (const ParameterRef* ref : number)
      job.parameters[zero].known_to.sd = std::max(job.parameters[zero].known_to.sd, job.parameters[*ref].known_to.sd);
    for (ParameterRef* ref : number) {
      ParameterRef moved = *ref;
      moved.plus += moved.times * job.parameters[*ref].value;
      moved.index = zero.index;
      *ref = moved;
    }
  }
  return job;
}

}  // namespace birefit::estimation
