#include "app/watch.h"

#include <cmath>
#include <iostream>
#include <system_error>
#include <utility>

#include <unistd.h>

#include "core/printable.h"
#include "io/results/work.h"

namespace birefit {

Watch::Watch(bool quiet, std::function<double(double)> left)
    : quiet_(quiet), terminal_(!quiet && ::isatty(STDERR_FILENO)), left_(std::move(left)) {
  if (quiet_) return;
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error&) {
    // No thread to be had: the work goes on unwatched.
  }
}

Watch::~Watch() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  ended_.notify_all();
  if (thread_.joinable()) thread_.join();
  if (terminal_) std::cerr << "\r\033[K" << std::flush;
}

void Watch::say(const std::string& line) {
  const std::lock_guard lock(mutex_);
  line_ = printable(line);
  if (terminal_) show();
}

void Watch::show() {
  const std::string text = line_.empty() ? time_ : time_.empty() ? line_ : line_ + " (" + time_ + ")";
  if (terminal_)
    std::cerr << "\r\033[K" << text << std::flush;
  else
    std::cerr << "birefit: " << text << std::endl;
}

void Watch::run() {
  using std::chrono::seconds;
  // Short works are over before anybody asks. A terminal is looked at; a log is read afterwards.
  const seconds first(terminal_ ? 3 : 60), then(terminal_ ? 1 : 60);
  std::unique_lock lock(mutex_);
  for (bool asked = false; !ended_.wait_for(lock, asked ? then : first, [this] { return end_; }); asked = true) {
    lock.unlock();
    const double left = left_(elapsed()), now = elapsed();
    lock.lock();
    time_ = "after " + describe_duration(now);
    if (std::isfinite(left))
      time_ += left > 0 ? ", about " + describe_duration(left) + " left" : ", longer than foreseen";
    if (!end_) show();
  }
}

}  // namespace birefit
