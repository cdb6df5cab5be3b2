#pragma once
// Parallel loops whose result does not depend on the number of threads: every index writes only its own output.

#include <atomic>
#include <functional>

namespace birefit {

/// Cores to use for `requested` (0 = all).
int thread_count(int requested);

/// Calls body(i) for i in [0, n), spread over threads in blocks; returns when all are done. The first exception of a
/// body is rethrown here.
void parallel_for(int n, int threads, const std::function<void(int)>& body);

/// Calls body(t) for t in [0, threads), each on a thread of its own and all at the same time, so that they may wait for
/// each other; a body must not throw. parallel_for promises no such thing, and is cheaper to call.
void run_together(int threads, const std::function<void(int)>& body);

/// Where those threads wait for each other. Phases of a picture last some ten microseconds and to be woken takes
/// longer: who waits looks again for about as long before it sleeps (std::barrier sleeps after some 16 looks: two
/// threads were hardly faster than one).
class Barrier {
 public:
  explicit Barrier(int threads) : threads_(threads) {}
  void arrive_and_wait();

 private:
  const int threads_;
  std::atomic<int> arrived_{0};
  std::atomic<unsigned> phase_{0};
};

}  // namespace birefit
