#include "core/threads.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace birefit {

int thread_count(int requested) {
  if (requested > 0) return requested;
  static const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));  // asks the system, which takes its time
  return cores;
}

void parallel_for(int n, int threads, const std::function<void(int)>& body) {
  threads = std::min(thread_count(threads), n);
  if (threads <= 1) {
    for (int i = 0; i < n; ++i) body(i);
    return;
  }
  // Neighbouring indices share memory (rows of an image): a few blocks a thread, no smaller than needed to even out.
  const int block = std::clamp(n / (8 * threads), 1, 16);
  std::atomic<int> next{0};
  std::exception_ptr failure;
  std::mutex failure_guard;
  const auto work = [&] {
    try {
      for (int first = next.fetch_add(block); first < n; first = next.fetch_add(block))
        for (int i = first; i < std::min(n, first + block); ++i) body(i);
    } catch (...) {
      const std::lock_guard lock(failure_guard);
      if (!failure) failure = std::current_exception();
      next = n;
    }
  };
  std::vector<std::thread> others;
  for (int t = 1; t < threads; ++t) others.emplace_back(work);
  work();
  for (std::thread& t : others) t.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace birefit
