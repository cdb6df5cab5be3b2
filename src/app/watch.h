#pragma once
// How far a long work has come, on standard error: on a terminal one line that changes, elsewhere a line a minute, so
// that a log shows that something still runs.

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace birefit {

class Watch {
 public:
  /// `left`: seconds that are left after so many, NaN where nobody knows; asked on a thread of its own, first after
  /// some seconds, and may take a while. `quiet`: nothing is said.
  Watch(bool quiet, std::function<double(double elapsed)> left);
  /// Clears the terminal's line.
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  bool quiet() const { return quiet_; }
  /// What is being done now; from any thread.
  void say(const std::string& line);

 private:
  void run();
  double elapsed() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }
  void show();  ///< under the mutex

  const bool quiet_, terminal_;
  const std::function<double(double)> left_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  std::condition_variable ended_;
  bool end_ = false;
  std::string line_;
  std::string time_;  ///< what was known of the time when it was last asked for
  std::thread thread_;
};

}  // namespace birefit
