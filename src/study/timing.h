#pragma once
// How long something takes.

#include <algorithm>
#include <chrono>
#include <limits>

namespace birefit::study {

/// Seconds of one call: the best of a few timings that each last long enough for the clock.
template <class Work>
double seconds_of(const Work& work) {
  using Clock = std::chrono::steady_clock;
  double best = std::numeric_limits<double>::infinity();
  int calls = 1;
  for (int timing = 0; timing < 5; ++timing) {
    for (;;) {
      const auto start = Clock::now();
      for (int i = 0; i < calls; ++i) work();
      const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
      if (seconds < 1e-3) {
        calls *= 4;
        continue;
      }
      best = std::min(best, seconds / calls);
      if (seconds > 0.2) return best;  // slow enough for one timing
      break;
    }
  }
  return best;
}

}  // namespace birefit::study
