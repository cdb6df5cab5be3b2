// Parallel loops: every index once, whoever asks and however deep; the first failure comes back.

#include "core/threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace birefit {
namespace {

TEST(Threads, EveryIndexOnce) {
  for (const int threads : {1, 2, 5})
    for (const int n : {0, 1, 3, 1000}) {
      std::vector<int> count(static_cast<std::size_t>(n), 0);
      parallel_for(n, threads, [&](int i) { ++count[static_cast<std::size_t>(i)]; });
      for (const int c : count) EXPECT_EQ(c, 1);
    }
}

TEST(Threads, LoopsInsideLoopsAndFromSeveralThreadsEnd) {
  std::atomic<int> total{0};
  const auto nested = [&] {
    for (int round = 0; round < 50; ++round)
      parallel_for(7, 3, [&](int) { parallel_for(5, 4, [&](int) { parallel_for(2, 2, [&](int) { ++total; }); }); });
  };
  std::thread other(nested);
  nested();
  other.join();
  EXPECT_EQ(total, 2 * 50 * 7 * 5 * 2);
}

TEST(Threads, AFailureOfAnyIndexIsThrownAndTheNextLoopWorks) {
  for (const int bad : {0, 57, 99})
    EXPECT_THROW(parallel_for(100, 4,
                              [&](int i) {
                                if (i == bad) throw std::runtime_error("bad");
                              }),
                 std::runtime_error);
  std::atomic<int> total{0};
  parallel_for(100, 4, [&](int i) { total += i; });
  EXPECT_EQ(total, 4950);
}

TEST(Threads, TogetherMeansAtTheSameTimeAndNoneGoesAhead) {
  constexpr int kThreads = 6;  // more than there may be cores or helpers
  constexpr int kPhases = 200;
  Barrier barrier(kThreads);
  std::atomic<int> arrived{0}, out_of_step{0};
  run_together(kThreads, [&](int) {
    for (int phase = 1; phase <= kPhases; ++phase) {
      ++arrived;
      barrier.arrive_and_wait();
      if (arrived != phase * kThreads) ++out_of_step;
      barrier.arrive_and_wait();  // nobody arrives anew before all have looked
    }
  });
  EXPECT_EQ(arrived, kPhases * kThreads);
  EXPECT_EQ(out_of_step, 0);
}

}  // namespace
}  // namespace birefit
