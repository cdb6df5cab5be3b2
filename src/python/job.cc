#include "python/job.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>

#include <pybind11/stl.h>

#include "birefit/error.h"
#include "core/threads.h"
#include "io/config/overrides.h"
#include "io/config/reader.h"
#include "io/report/explain.h"
#include "io/results/picture.h"
#include "io/results/work.h"
#include "python/tree.h"

namespace birefit::python {
namespace {

/// What an array in place of the config's image is called.
constexpr const char* kImage = "image";

std::vector<int> free_indices(const ParameterTable& table) {
  std::vector<int> indices;
  for (const bool linear : {false, true})
    for (int i = 0; i < table.size(); ++i)
      if (table[i].free && table[i].linear == linear) indices.push_back(i);
  return indices;
}

/// What is tied follows, but for numbers that the caller gave: these are known then, as by --set. A value that a tied
/// number may not have is the caller's mistake.
void follow(const ParameterTable& table, const ValueRanges& ranges, const std::vector<int>& given, const Where& where,
            Theta& theta) {
  for (const int index : table.tied()) {
    if (std::find(given.begin(), given.end(), index) != given.end()) continue;
    double& now = theta[static_cast<std::size_t>(index)];
    const double value = table.value_of(*table.tie_of(index), theta);
    if (value == now || (std::isnan(value) && std::isnan(now))) continue;
    ranges.check(table, index, value, where);
    now = value;
  }
}

/// d(picture)/d(number) through what is tied to it: `by` times the derivative by the entry at place `from` of the
/// active ones adds to that at place `to`.
struct Link {
  std::size_t to, from;
  double by;
};
std::vector<Link> links_of(const ParameterTable& table, const std::vector<int>& given, const Theta& theta,
                           std::vector<int>& active) {
  const std::size_t wanted = active.size();
  std::vector<Link> links;
  for (const int tied : table.tied()) {
    if (wanted == 0 || std::find(given.begin(), given.end(), tied) != given.end()) continue;
    const std::size_t before = links.size();
    for (const TieSlope& slope : table.slopes(tied, theta))
      for (std::size_t j = 0; j < wanted; ++j)
        if (active[j] == slope.index) links.push_back({j, active.size(), slope.by});
    if (links.size() > before) active.push_back(tied);
  }
  return links;
}

}  // namespace

Job::Job(std::string text, std::string name, std::vector<std::string> set,
         const std::map<std::string, py::array>& images, const std::map<std::string, py::bytes>& fields,
         const ImageInPlace& image)
    : text_(std::move(text)), name_(std::move(name)), set_(std::move(set)), image_(image) {
  for (const auto& [key, array] : images) in_memory_.images.emplace(key, image_of(array, key));
  for (const auto& [key, bytes] : fields)
    in_memory_.fields.emplace(key, std::make_shared<const std::string>(bytes.cast<std::string>()));
  try {
    pictured_ = load(ConfigUse::render, image_);
  } catch (const UserError& error) {
    if (!std::holds_alternative<std::monostate>(image_)) throw;
    try {
      // Sound but for the size of its pictures, which a fit takes from an image that is yet to come.
      pictured_ = load(ConfigUse::render, image_, {"image_size_px=[64, 64]"});
      Problems said;  // by load()
      pictured_.text = text_as_set(text_, parse_config(text_, name_, set_, said), set_);
    } catch (const UserError&) {
      throw error;
    }
    no_size_ = error;
  }
  ranges_.emplace(pictured_);
  if (!no_size_) check_memory(pictured_, memory_to_render(pictured_.scene));
}

Config Job::load(ConfigUse use, const ImageInPlace& image, const std::vector<std::string>& more) const {
  std::vector<std::string> set = set_;
  set.insert(set.end(), more.begin(), more.end());
  InMemory in_memory = in_memory_;
  std::optional<std::filesystem::path> file;
  if (const auto* path = std::get_if<std::string>(&image)) file = *path;
  if (const auto* array = std::get_if<py::array>(&image)) {
    std::string name = kImage;  // beside arrays that have a name of the user's
    while (in_memory.images.contains(name) || in_memory.fields.contains(name)) name += "'";
    in_memory.images.emplace(name, image_of(*array, kImage));
    file = name;
  }
  const py::gil_scoped_release unlocked;
  return load_config_text(text_, name_, use, file, set, &in_memory);
}

Config Job::for_fit(const ImageInPlace& image) const {
  return load(ConfigUse::fit, std::holds_alternative<std::monostate>(image) ? image_ : image);
}

void Job::check_pictured() const {
  if (no_size_) throw *no_size_;
}

std::vector<std::string> Job::warnings() const {
  std::vector<std::string> all = pictured_.job.warnings;
  all.insert(all.end(), pictured_.job.taken_as_exact.begin(), pictured_.job.taken_as_exact.end());
  return all;
}

py::list Job::parameters() const {
  py::list list;
  const ParameterTable& table = pictured_.job.parameters;
  // What all pictures have for themselves stands in the table once more, and nothing reads it there.
  std::set<int> read;
  for (int i = 0; i < table.size(); ++i)
    if (table[i].free || table[i].linear || ranges_->reads(i)) {
      read.insert(i);
      for (const int root : table.roots(i)) read.insert(root);
    }
  for (const int i : read)
    if (table.find(table[i].name).index == i)  // of one name the first is meant
      list.append(py::make_tuple(table[i].name, table[i].unit, table[i].value, table[i].free));
  return list;
}

std::vector<std::string> Job::free_names() const {
  std::vector<std::string> names;
  for (const int i : free_indices(pictured_.job.parameters)) names.push_back(pictured_.job.parameters[i].name);
  return names;
}

int Job::index_of(const std::string& name, const std::string& call) const {
  return parameter_named(pictured_.job.parameters, name, {call}).index;
}

std::vector<int> Job::indices_of(const std::vector<std::string>& names, const std::string& call) const {
  std::vector<int> indices;
  for (const std::string& name : names) {
    indices.push_back(index_of(name, call));
    const std::size_t first = static_cast<std::size_t>(std::ranges::find(indices, indices.back()) - indices.begin());
    if (first + 1 < indices.size())
      throw UserError({call}, "'" + names[first] + "' and '" + name + "' are one number", "name every number once");
  }
  return indices;
}

std::array<int, 3> Job::shape() const {
  check_pictured();
  const View& view = pictured_.scene.view;
  return {view.height, view.width, static_cast<int>(scenes_of(pictured_).size())};
}

std::shared_ptr<const Job::Planned> Job::planned_at(const Theta& theta) const {
  {
    const std::lock_guard lock(mutex_);
    if (planned_ && planned_->theta == theta) return planned_;
  }
  const auto made = std::make_shared<const Planned>(Planned{theta, plans_of(pictured_, theta)});
  const std::lock_guard lock(mutex_);
  return planned_ = made;
}

py::tuple Job::render(const std::vector<std::pair<std::string, double>>& values,
                      const std::vector<std::pair<std::string, double>>& more, const std::vector<std::string>& active,
                      int threads) const {
  check_pictured();
  const ParameterTable& table = pictured_.job.parameters;
  Theta theta = table.values();
  std::vector<int> given;
  for (const auto* changes : {&values, &more}) {
    std::vector<std::string> changed;
    for (const auto& change : *changes) changed.push_back(change.first);
    const std::vector<int> at = indices_of(changed, "render");
    for (std::size_t i = 0; i < at.size(); ++i) {
      ranges_->check(table, at[i], (*changes)[i].second, {"render"});
      theta[static_cast<std::size_t>(at[i])] = (*changes)[i].second;
    }
    given.insert(given.end(), at.begin(), at.end());
  }
  follow(table, *ranges_, given, {"render"}, theta);
  std::vector<int> indices = indices_of(active, "derivatives");
  const std::vector<Link> links = links_of(table, given, theta, indices);
  std::vector<Rendering> colours;
  {
    const py::gil_scoped_release unlocked;
    do_placed(pictured_, memory_to_render(pictured_.scene),
              [&] { colours = render_config(pictured_, planned_at(theta)->plans, theta, indices, threads); });
  }
  std::vector<Image> picture, derivatives;
  for (Rendering& colour : colours) {
    for (const Link& link : links)
      for (std::size_t p = 0; p < colour.derivatives[link.to].size(); ++p)
        colour.derivatives[link.to].values()[p] += link.by * colour.derivatives[link.from].values()[p];
    colour.derivatives.resize(active.size());
    picture.push_back(std::move(colour.intensity));
    for (Image& derivative : colour.derivatives) derivatives.push_back(std::move(derivative));
  }
  if (active.empty()) return py::make_tuple(array_of(std::move(picture)), py::none());
  const auto [rows, columns, count] = shape();
  // (rows, columns, parameters), or (rows, columns, colours, parameters).
  py::array jacobian = array_of(std::move(derivatives));
  if (jacobian.ndim() == 2) jacobian = jacobian.attr("reshape")(rows, columns, 1).cast<py::array>();
  if (count > 1) jacobian = jacobian.attr("reshape")(rows, columns, count, active.size()).cast<py::array>();
  return py::make_tuple(array_of(std::move(picture)), jacobian);
}

py::array Job::render_many(const std::vector<std::string>& names, const Doubles& values, int threads) const {
  check_pictured();
  const ParameterTable& table = pictured_.job.parameters;
  const Where where{"render_many"};
  if (values.ndim() != 2 || values.shape(1) != std::ssize(names))
    throw UserError(where, "the values have another shape than (pictures, " + std::to_string(names.size()) + ")",
                    "a row a picture, and in it a number for each of " + list_words(names));
  const std::vector<int> indices = indices_of(names, "render_many");
  const py::ssize_t pictures = values.shape(0);
  std::vector<Theta> thetas(static_cast<std::size_t>(pictures), table.values());
  for (py::ssize_t i = 0; i < pictures; ++i)
    for (std::size_t j = 0; j < indices.size(); ++j) {
      const double value = values.at(i, static_cast<py::ssize_t>(j));
      ranges_->check(table, indices[j], value, {"render_many, row " + std::to_string(i)});
      thetas[static_cast<std::size_t>(i)][static_cast<std::size_t>(indices[j])] = value;
      if (j + 1 == indices.size())
        follow(table, *ranges_, indices, {"render_many, row " + std::to_string(i)},
               thetas[static_cast<std::size_t>(i)]);
    }
  const auto [rows, columns, count] = shape();
  std::vector<py::ssize_t> shape{pictures, rows, columns};
  if (count > 1) shape.push_back(count);
  py::array_t<double> all(shape);
  double* const out = all.mutable_data();
  const std::size_t pixels = static_cast<std::size_t>(rows) * columns, one = pixels * static_cast<std::size_t>(count);
  const auto write = [&, count = count](int i, int threads_of_one) {
    const Theta& theta = thetas[static_cast<std::size_t>(i)];
    const std::vector<Rendering> colours =
        render_config(pictured_, plans_of(pictured_, theta), theta, {}, threads_of_one);
    double* const picture = out + static_cast<std::size_t>(i) * one;
    for (int c = 0; c < count; ++c)
      for (std::size_t p = 0; p < pixels; ++p)
        picture[p * static_cast<std::size_t>(count) + static_cast<std::size_t>(c)] =
            colours[static_cast<std::size_t>(c)].intensity.values()[p];
  };
  const py::gil_scoped_release unlocked;
  do_work(pictured_, memory_to_render(pictured_.scene) + 8.0 * static_cast<double>(one) * pictures, [&] {
    if (pictures == 0) return;
    // Waves take memory by the gigabyte: one at a time. Else a picture a core, when there are enough of them.
    const bool waves = planned_at(thetas[0])->plans[0].wave != nullptr;
    const bool apart = !waves && pictures >= thread_count(threads);
    // A few at a time, so that Ctrl-C is seen.
    const int at_once = apart ? 16 * thread_count(threads) : 1;
    for (int begin = 0; begin < static_cast<int>(pictures); begin += at_once) {
      parallel_for(std::min(at_once, static_cast<int>(pictures) - begin), apart ? threads : 1,
                   [&](int i) { write(begin + i, apart ? 1 : threads); });
      const py::gil_scoped_acquire locked;
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
  });
  return all;
}

std::string Job::explain(const std::string& next, bool json) const {
  const Config config = load(ConfigUse::plan, image_);
  const py::gil_scoped_release unlocked;
  return do_work(config, memory_to_render(config.scene), [&] {
    const Explanation explanation = birefit::explain(config, next);
    return json ? explanation_json(config, explanation) : explanation_text(config, explanation);
  });
}

std::shared_ptr<Objective> Job::objective(int threads) const {
  Config config = load(ConfigUse::fit, image_);
  const py::gil_scoped_release unlocked;
  config.job.options.threads = threads;
  return do_work(config, memory_to_fit(config.job), [&] { return std::make_shared<Objective>(config.job); });
}

void define_job(py::module_& module) {
  py::class_<Job>(module, "Job")
      .def(py::init<std::string, std::string, std::vector<std::string>, const std::map<std::string, py::array>&,
                    const std::map<std::string, py::bytes>&, const ImageInPlace&>())
      .def_property_readonly("text", &Job::text)
      .def_property_readonly("warnings", &Job::warnings)
      .def_property_readonly("parameters", &Job::parameters)
      .def_property_readonly("free_names", &Job::free_names)
      .def_property_readonly("shape", &Job::shape)
      .def("render", &Job::render)
      .def("render_many", &Job::render_many)
      .def("explain", &Job::explain)
      .def("objective", &Job::objective)
      .def("fit", [](const Job& job, const ImageInPlace& image, const py::object& progress, int threads, int samples) {
        return run_fit(job.for_fit(image), progress, threads, samples);
      });
  module.def("text_of_tree", &text_of_tree);
  // Bytes: whether they are text is for the reader of configs to say.
  module.def("read_text", [](const std::string& path) { return py::bytes(read_text(path)); });
  module.def("path_named", [](const std::vector<std::string>& paths, const std::string& name, const std::string& call) {
    return path_named(paths, name, {call});
  });
}

}  // namespace birefit::python
