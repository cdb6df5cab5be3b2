#include "fit/problem/task.h"

#include <algorithm>
#include <map>
#include <set>

#include "fit/problem/light.h"
#include "medium/references.h"

namespace birefit::estimation {
namespace {

/// Values as a row of pixels.
std::shared_ptr<Picture> as_picture(const Readings& readings, const Scene& scene, const Eigen::VectorXd& values) {
  auto picture = std::make_shared<Picture>();
  const int width = static_cast<int>(values.size());
  picture->name = readings.name;
  picture->scene = scene;
  picture->scene.view.width = width, picture->scene.view.height = 1;
  picture->values = Image(width, 1);
  std::copy(values.begin(), values.end(), picture->values.values().begin());
  picture->mask = Mask(width, 1, 1);
  picture->gain = readings.gain, picture->offset = readings.offset;
  picture->noise = readings.noise;
  return picture;
}

void add_sights(const Readings& readings, std::vector<Sight>& sights) {
  if (readings.observable.quantity == Quantity::ring_radius_cm) {
    sights.push_back(
        {as_picture(readings, readings.rows.front(), readings.values), readings.observable, readings.name});
    return;
  }
  for (std::size_t i = 0; i < readings.rows.size(); ++i) {
    const auto picture =
        as_picture(readings, readings.rows[i], readings.values.segment(static_cast<Eigen::Index>(i), 1));
    if (i < readings.lines.size()) picture->name += ":" + std::to_string(readings.lines[i]);
    sights.push_back({picture, readings.observable, readings.name, readings.noise_at_most});
  }
}

}  // namespace

Unknowns Unknowns::of(const FitJob& job) {
  Unknowns unknowns;
  std::vector<bool> linear(job.parameters.size(), false);
  const auto mark = [&](ParameterRef ref) {
    if (ref) linear[static_cast<std::size_t>(ref.index)] = true;
  };
  for (const Measurement& measurement : job.measurements) {
    if (const Picture* picture = std::get_if<Picture>(&measurement))
      for (const LightTerm& term : light_terms(*picture)) mark(term.coefficient);
    else
      mark(std::get<Readings>(measurement).gain), mark(std::get<Readings>(measurement).offset);
  }
  for (int i = 0; i < job.parameters.size(); ++i)
    if (job.parameters[i].free)
      (linear[static_cast<std::size_t>(i)] ? unknowns.linear : unknowns.searched).push_back(i);
  return unknowns;
}

std::vector<Sight> sights_of(const FitJob& job) {
  std::vector<Sight> sights;
  for (const Measurement& measurement : job.measurements) {
    if (const Picture* picture = std::get_if<Picture>(&measurement))
      // the job keeps it
      sights.push_back({std::shared_ptr<const Picture>(std::shared_ptr<void>(), picture), {}, picture->name});
    else
      add_sights(std::get<Readings>(measurement), sights);
  }
  return sights;
}

bool are_colours(const Task& task) {
  std::set<int> gains;
  for (int g = 0; g < task.frames(); ++g) {
    if (!task.picture(g).scene.microscope.channel_light) return false;
    gains.insert(task.picture(g).gain.index);
  }
  return static_cast<int>(gains.size()) == task.frames();
}

bool follows_from(const ParameterTable& table, ParameterRef number, int index) {
  const std::vector<int> roots = table.roots(number.index);
  return std::find(roots.begin(), roots.end(), index) != roots.end();
}

namespace {

/// How many frames read each number that is not fitted.
std::map<int, int> readers_of_known(const Task& task) {
  std::map<int, int> readers;
  for (int g = 0; g < task.frames(); ++g) {
    std::set<int> read;
    for_each_ref(task.picture(g).scene, [&](const ParameterRef& ref) {
      for (const int root : ref ? task.job.parameters.roots(ref.index) : std::vector<int>{})
        if (!task.job.parameters[root].free) read.insert(root);
    });
    for (const int index : read) ++readers[index];
  }
  return readers;
}

}  // namespace

std::vector<int> known_to_some_frames(const Task& task) {
  std::vector<int> known;
  for (const auto& [index, number] : readers_of_known(task)) known.push_back(index);
  return known;
}

std::vector<int> known_to_all_frames(const Task& task) {
  std::vector<int> known;
  for (const auto& [index, number] : readers_of_known(task))
    if (number == task.frames()) known.push_back(index);
  return known;
}

}  // namespace birefit::estimation
