#include "core/threads.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace birefit {
namespace {

/// Until condition() holds, but no longer than a phase of a picture lasts (tens of microseconds).
template <class Condition>
bool look_for(const Condition& condition) {
  constexpr int kLooks = 4000;
  for (int i = 0; i < kLooks; ++i) {
    if (condition()) return true;
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  return false;
}

/// Threads that wait for work. They live as long as the program: a picture takes a millisecond, of which making a
/// thread and the memory it works in would be a third.
class Helpers {
 public:
  static Helpers& instance() {
    static Helpers helpers;
    return helpers;
  }
  ~Helpers() {
    {
      const std::lock_guard lock(guard_);
      closing_ = true;
    }
    wake_.notify_all();
    for (std::thread& t : members_) t.join();
  }
  /// Calls work() here and, where members are free before it returns, in up to `helpers` of them at the same time. A
  /// call within work() is none the worse: who finds nobody free does all by himself.
  void run(int helpers, const std::function<void()>& work) {
    Job job{&work, helpers, 0};
    {
      const std::lock_guard lock(guard_);
      try {
        while (members_.size() < static_cast<std::size_t>(helpers)) members_.emplace_back([this] { serve(); });
      } catch (const std::system_error&) {
        // No more are to be had (limits of a container): those there are do the work.
      }
      jobs_.push_back(&job);
      waiting_jobs_ = static_cast<int>(jobs_.size());
    }
    if (helpers == 1)
      wake_.notify_one();
    else
      wake_.notify_all();
    work();
    {
      const std::lock_guard lock(guard_);
      std::erase(jobs_, &job);  // whoever has not begun is not needed any more
      waiting_jobs_ = static_cast<int>(jobs_.size());
    }
    look_for([&] { return job.running == 0; });
    std::unique_lock lock(guard_);  // also: whoever was last has let go of the job
    finished_.wait(lock, [&] { return job.running == 0; });
  }

 private:
  struct Job {
    const std::function<void()>* work;
    int wanted;                ///< members still to join
    std::atomic<int> running;  ///< members at it; changes under the guard
  };
  void serve() {
    std::unique_lock lock(guard_);
    for (;;) {
      lock.unlock();
      look_for([&] { return waiting_jobs_ > 0; });
      lock.lock();
      wake_.wait(lock, [&] { return closing_ || !jobs_.empty(); });
      if (closing_) return;
      Job& job = *jobs_.front();
      if (--job.wanted == 0) jobs_.pop_front();
      waiting_jobs_ = static_cast<int>(jobs_.size());
      ++job.running;
      lock.unlock();
      (*job.work)();
      lock.lock();
      if (--job.running == 0) finished_.notify_all();
    }
  }
  std::mutex guard_;
  std::condition_variable wake_, finished_;
  std::deque<Job*> jobs_;
  std::atomic<int> waiting_jobs_{0};  ///< jobs_.size(), for who looks without the guard
  std::vector<std::thread> members_;
  bool closing_ = false;
};

}  // namespace

int thread_count(int requested) {
  if (requested > 0) return requested;
  // asks the system, which takes its time
  static const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
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
  Helpers::instance().run(threads - 1, [&] {
    try {
      for (int first = next.fetch_add(block); first < n; first = next.fetch_add(block))
        for (int i = first; i < std::min(n, first + block); ++i) body(i);
    } catch (...) {
      const std::lock_guard lock(failure_guard);
      if (!failure) failure = std::current_exception();
      next = n;
    }
  });
  if (failure) std::rethrow_exception(failure);
}

/// Where there are not so many threads to be had: std::system_error, and no body was called.
void run_together(int threads, const std::function<void(int)>& body) {
  enum class Start { not_yet, all_there, too_few };
  std::atomic<Start> start{Start::not_yet};
  std::vector<std::thread> others;
  others.reserve(static_cast<std::size_t>(threads));
  const auto let_go = [&](Start how) {
    start = how;
    start.notify_all();
  };
  const auto join = [&] {
    for (std::thread& t : others) t.join();
  };
  try {
    for (int t = 1; t < threads; ++t)
      others.emplace_back([&, t] {
        start.wait(Start::not_yet);
        if (start == Start::all_there) body(t);
      });
  } catch (const std::system_error&) {
    let_go(Start::too_few);
    join();
    throw;
  }
  let_go(Start::all_there);
  body(0);
  join();
}

void Barrier::arrive_and_wait() {
  const unsigned phase = phase_.load(std::memory_order_acquire);
  if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == threads_) {
    arrived_.store(0, std::memory_order_relaxed);
    phase_.store(phase + 1, std::memory_order_release);
    phase_.notify_all();
    return;
  }
  if (!look_for([&] { return phase_.load(std::memory_order_acquire) != phase; }))
    phase_.wait(phase, std::memory_order_acquire);
}

}  // namespace birefit
