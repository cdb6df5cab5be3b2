// Fits as Python asks for them, and what they come to.

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <thread>

#include <pybind11/stl.h>

#include "birefit/error.h"
#include "io/results/work.h"
#include "io/results/write.h"
#include "python/job.h"

namespace birefit::python {
namespace {

/// A fit in a thread of its own, seen from the one that waits for it.
class Running {
 public:
  explicit Running(std::shared_ptr<Fitted> fitted) : fitted_(std::move(fitted)) {
    FitOptions& options = fitted_->config.job.options;
    options.interrupted = &interrupted_;
    options.progress = [this](const std::string& line) {
      const std::lock_guard lock(mutex_);
      lines_.push_back(line);
      changed_.notify_one();
    };
    thread_ = std::thread([this] { run(); });
  }
  ~Running() {
    interrupted_ = true;
    thread_.join();
    FitOptions& options = fitted_->config.job.options;  // outlives this
    options.interrupted = nullptr;
    options.progress = {};
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  /// Waits for a line, the end, or some time; true while the fit goes on or there are lines.
  bool wait(std::deque<std::string>& lines) {
    // As short as a hand on Ctrl-C does not notice.
    constexpr std::chrono::milliseconds kLook(50);
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kLook, [&] { return done_ || !lines_.empty(); });
    lines = std::exchange(lines_, {});
    return !done_ || !lines.empty();
  }
  void stop() { interrupted_ = true; }
  bool failed() const { return failure_ != nullptr; }
  void throw_if_failed() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  void run() {
    try {
      fitted_->result = fit_config(fitted_->config);
    } catch (...) {
      failure_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    done_ = true;
    changed_.notify_one();
  }

  std::shared_ptr<Fitted> fitted_;
  std::atomic<bool> interrupted_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> lines_;
  bool done_ = false;
  std::exception_ptr failure_;
  std::thread thread_;
};

/// Calls `progress` with each line, and lets signals act; throws what either raises.
void let_python_act(const std::deque<std::string>& lines, const py::object& progress) {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  if (progress.is_none()) return;
  for (const std::string& line : lines) progress(line);
}

py::list fitted_pictures(const std::shared_ptr<Fitted>& fitted, Image MicrographResult::*which) {
  py::list list;
  for (const MicrographResult& m : fitted->result.micrographs) list.append(view_of(m.*which, fitted));
  return list;
}

py::dict files_of(const Fitted& fitted, const std::vector<std::string>& formats) {
  std::vector<FileContent> files;
  {
    const py::gil_scoped_release unlocked;
    files = do_work(fitted.config, memory_to_fit(fitted.config.job),
                    [&] { return result_files(fitted.config, fitted.result, formats); });
  }
  py::dict all;
  for (const FileContent& file : files) all[py::str(file.path.string())] = py::bytes(file.content);
  return all;
}

void write_files_of(const std::string& folder, const std::map<std::string, py::bytes>& contents) {
  std::vector<FileContent> files;
  for (const auto& [name, content] : contents)
    if (name != "fit.json") files.push_back({name, content.cast<std::string>()});
  // Last: a script that waits for fit.json finds everything else in place.
  if (const auto fit = contents.find("fit.json"); fit != contents.end())
    files.push_back({fit->first, fit->second.cast<std::string>()});
  const py::gil_scoped_release unlocked;
  write_result_files(folder, std::move(files));
}

Eigen::VectorXd vector_of(const Doubles& values) {
  if (values.ndim() != 1) throw std::invalid_argument("theta is (parameters,)");
  return Eigen::Map<const Eigen::VectorXd>(values.data(), values.size());
}

/// One number, or one a row of points.
py::object log_posteriors(const Objective& objective, const Doubles& theta) {
  if (theta.ndim() == 1) {
    const Eigen::VectorXd point = vector_of(theta);
    const py::gil_scoped_release unlocked;
    const double value = objective.log_posterior(point);
    const py::gil_scoped_acquire locked;
    return py::float_(value);
  }
  if (theta.ndim() != 2 || theta.shape(1) != objective.start().size())
    throw std::invalid_argument("theta is (parameters) or (points, parameters)");
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Rows points = Eigen::Map<const Rows>(theta.data(), theta.shape(0), theta.shape(1));
  Eigen::VectorXd values(points.rows());
  {
    const py::gil_scoped_release unlocked;
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      values[i] = objective.log_posterior(points.row(i).transpose());
      const py::gil_scoped_acquire locked;
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
  }
  return array_of(std::move(values));
}

}  // namespace

py::object run_fit(Config config, const py::object& progress, int threads, int samples) {
  const auto fitted = std::make_shared<Fitted>();
  fitted->config = std::move(config);
  if (threads > 0) fitted->config.job.options.threads = threads;
  fitted->config.job.options.samples = samples;
  std::optional<py::error_already_set> raised;
  bool ended = false;
  {
    Running running(fitted);
    std::deque<std::string> lines;
    for (bool on = true; on;) {
      {
        const py::gil_scoped_release unlocked;
        on = running.wait(lines);
      }
      if (raised) continue;  // it ends as soon as it can
      try {
        let_python_act(lines, progress);
      } catch (py::error_already_set& error) {
        raised.emplace(error);
        running.stop();
      }
    }
    if (!raised) running.throw_if_failed();
    ended = !running.failed();
  }
  const py::object result = py::cast(std::shared_ptr<Fitted>(fitted));
  if (!raised) return result;
  if (!raised->matches(PyExc_KeyboardInterrupt) || !ended) throw *raised;
  return py::make_tuple(result, py::str("interrupted"));
}

void define_result(py::module_& module) {
  py::class_<Fitted, std::shared_ptr<Fitted>>(module, "Fitted")
      .def_property_readonly("json", [](const Fitted& f) { return fit_json(f.config, f.result); })
      .def_property_readonly("summary", [](const Fitted& f) { return summary(f.result); })
      .def_property_readonly("has_answer", [](const Fitted& f) { return f.result.has_answer(); })
      .def_property_readonly(
          "fitted", [](const std::shared_ptr<Fitted>& f) { return fitted_pictures(f, &MicrographResult::fitted); })
      .def_property_readonly(
          "residual", [](const std::shared_ptr<Fitted>& f) { return fitted_pictures(f, &MicrographResult::residual); })
      .def_property_readonly(
          "sigma", [](const std::shared_ptr<Fitted>& f) { return fitted_pictures(f, &MicrographResult::sigma); })
      .def_property_readonly("samples",
                             [](const Fitted& f) -> py::object {
                               if (!f.result.samples) return py::none();
                               return array_of(f.result.samples->values);
                             })
      .def("files", &files_of)
      .def("objective", [](const Fitted& f, int threads) {
        const py::gil_scoped_release unlocked;
        FitJob job = f.config.job;
        job.options.threads = threads;
        return std::make_shared<Objective>(std::move(job), f.result);
      });
  module.def("write_files", &write_files_of);
  py::class_<Objective, std::shared_ptr<Objective>>(module, "Objective")
      .def_property_readonly("names", &Objective::names)
      .def_property_readonly("start", [](const Objective& o) { return array_of(o.start()); })
      .def_property_readonly("lower", [](const Objective& o) { return array_of(o.lower()); })
      .def_property_readonly("upper", [](const Objective& o) { return array_of(o.upper()); })
      .def_property_readonly("rows", &Objective::rows)
      .def("residual",
           [](const Objective& o, const Doubles& theta) {
             const Eigen::VectorXd point = vector_of(theta);
             Eigen::VectorXd rows;
             {
               const py::gil_scoped_release unlocked;
               rows = o.residual(point);
             }
             return array_of(std::move(rows));
           })
      .def("jacobian",
           [](const Objective& o, const Doubles& theta) {
             const Eigen::VectorXd point = vector_of(theta);
             Eigen::MatrixXd rows;
             {
               const py::gil_scoped_release unlocked;
               rows = o.jacobian(point);
             }
             return array_of(std::move(rows));
           })
      .def("log_posterior", &log_posteriors);
}

}  // namespace birefit::python
