#pragma once
// A config as Python holds it: read for pictures at once, for a fit when one is asked for.

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "birefit/io.h"
#include "birefit/objective.h"
#include "io/config/values.h"
#include "python/arrays.h"

namespace birefit::python {

/// What a fit came to, with what it was of.
struct Fitted {
  Config config;
  FitResult result;
};

/// What stands in place of the config's image: nothing, a file, or an array.
using ImageInPlace = std::variant<std::monostate, std::string, py::array>;

class Job {
 public:
  /// `name`: what messages call the text, and whose folder files are looked for in. `set`: items as of `--set`.
  /// `images`, `fields`: see InMemory. Throws UserError for what is wrong with the config; that it says nothing of its
  /// pictures' size is said when a picture is asked for.
  Job(std::string text, std::string name, std::vector<std::string> set, const std::map<std::string, py::array>& images,
      const std::map<std::string, py::bytes>& fields, const ImageInPlace& image);

  /// The config's text, as it is fitted.
  const std::string& text() const { return pictured_.text; }
  std::vector<std::string> warnings() const;
  /// (name, unit, value, free) of every number, in the table's order.
  py::list parameters() const;
  /// Names of the free ones, as results have them: searched, then linear.
  std::vector<std::string> free_names() const;
  /// Place in the table of the number that a name means; `call`: who asks.
  int index_of(const std::string& name, const std::string& call) const;
  /// Of several; no number may be named twice.
  std::vector<int> indices_of(const std::vector<std::string>& names, const std::string& call) const;
  /// Rows, columns and colours of render(). Throws UserError where the config does not say.
  std::array<int, 3> shape() const;

  /// The picture with these numbers changed, `more` above `values`, and (if any are `active`) its derivatives.
  py::tuple render(const std::vector<std::pair<std::string, double>>& values,
                   const std::vector<std::pair<std::string, double>>& more, const std::vector<std::string>& active,
                   int threads) const;
  /// A picture a row of `values`, whose columns are the numbers of these names.
  py::array render_many(const std::vector<std::string>& names, const Doubles& values, int threads) const;
  std::string explain(const std::string& next, bool json) const;

  /// The config read for a fit, of this image in place of its own.
  Config for_fit(const ImageInPlace& image) const;
  /// What a fit of it makes small.
  std::shared_ptr<Objective> objective(int threads) const;

 private:
  void check_pictured() const;
  Config load(ConfigUse use, const ImageInPlace& image, const std::vector<std::string>& more = {}) const;

  std::string text_, name_;
  std::vector<std::string> set_;
  InMemory in_memory_;
  ImageInPlace image_;
  Config pictured_;                   ///< read for ConfigUse::render
  std::optional<UserError> no_size_;  ///< why there is no picture of it
  std::optional<ValueRanges> ranges_;
  /// Plans of the values that were asked for last.
  struct Planned {
    Theta theta;
    std::vector<RenderPlan> plans;
  };
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const Planned> planned_;
  std::shared_ptr<const Planned> planned_at(const Theta& theta) const;
};

/// Fits in a thread of its own, while this one looks for signals and passes lines on to `progress` (None: nobody asks).
/// An exception of either ends the fit; one by a signal (KeyboardInterrupt) leaves as birefit.Interrupted with what was
/// found so far. `samples`: draws from the posterior.
py::object run_fit(Config config, const py::object& progress, int threads, int samples);

/// Adds what this module has of jobs and of results.
void define_job(py::module_& module);
void define_result(py::module_& module);

}  // namespace birefit::python
