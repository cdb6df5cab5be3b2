#pragma once
// What `birefit view` shows, without a word of HTTP: a job at values that the user tries, its picture and chi-square,
// fits in the background, the config with these values. Every reply is JSON, or JSON before numbers, for one page.

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "birefit/io.h"
#include "fit/trial.h"

namespace birefit::view {

/// The job at chosen values. Several threads may ask at once; pictures are made one at a time, and of those that wait
/// for one only the latest is made.
class Session {
 public:
  /// Nothing to show yet. `threads`: of renders and fits; 0 = all cores, < 0: as the config says.
  explicit Session(int threads = -1);
  /// Interrupts the fit that is running.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Shows a config that was read for a fit, and where it was fitted already its result. Throws UserError where there
  /// is nothing to fit to.
  void open(Config config, std::optional<FitResult> result = std::nullopt);

  /// What the page is made of: names, parameters with bounds, pictures and tables, the last fit.
  std::string description() const;
  /// Measured values and standard deviations of a picture or table (both float32, row by row; NaN where a pixel takes
  /// no part in the second).
  std::string measured(std::size_t item) const;
  /// The model at `values` of the searched parameters: a header (its length in 4 bytes, little endian, then JSON filled
  /// up with blanks to a multiple of 4) with chi-square, and the item's values as float32. `settle`: planned anew, as
  /// `birefit render` has it. Nothing where a later call came before this one's turn.
  std::optional<std::string> draw(std::size_t item, const std::vector<double>& values, bool settle);

  /// Starts a fit from these values, in the background; an earlier one that runs goes on, and this throws UserError.
  void start_fit(const std::vector<double>& values);
  /// The fit ends with the best it has.
  void stop_fit();
  /// What has changed since the state that the caller has `seen`, waiting so long for something to change: the state's
  /// number, the lines of the log from `line` on, whether a fit runs, and the number of the description.
  std::string news(long seen, std::size_t line, double seconds);
  /// Whoever waits for news is answered at once from now on.
  void close();
  /// Anything that the page shall hear of, a line of the log.
  void say(const std::string& line);
  /// Row `at` of the table below the pictures, as `watch` has it: cells under `columns`.
  void set_row(std::size_t at, const std::vector<std::string>& columns, std::vector<std::string> cells);

  /// What `birefit explain` says at these values; takes seconds.
  std::string words(const std::vector<double>& values) const;
  /// The config with these values as starts.
  std::string config_text(const std::vector<double>& values) const;
  /// Writes it into the config's folder under a plain file name; returns the path. Throws UserError for any other name
  /// and, unless `overwrite`, where there is such a file.
  std::filesystem::path save(const std::string& name, const std::vector<double>& values, bool overwrite) const;
  /// report.html of the last fit. Throws UserError where there is none.
  std::string report() const;

 private:
  struct Shown;
  std::shared_ptr<Shown> shown() const;
  std::shared_ptr<Shown> shown_of(Config config, std::optional<FitResult> result) const;
  void run_fit(std::shared_ptr<Shown> of, std::string text);
  void changed();

  const int threads_;
  mutable std::mutex guard_;  ///< of all below but trials
  std::condition_variable news_;
  std::shared_ptr<Shown> shown_;
  long state_ = 0, description_ = 0, rows_set_ = 0;
  std::vector<std::string> log_, columns_;
  std::vector<std::vector<std::string>> rows_;
  bool running_ = false, ended_ = false;
  std::atomic<bool> stop_{false};
  std::thread fit_;

  mutable std::mutex busy_;  ///< a picture is being made
  std::atomic<long> latest_{0};
};

}  // namespace birefit::view
