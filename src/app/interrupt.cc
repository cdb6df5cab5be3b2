#include "app/interrupt.h"

#include <csignal>

#include "io/files/file.h"

namespace birefit {
namespace {

std::atomic<bool> g_interrupted{false}, g_listening{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

void on_signal(int signal) {
  if (g_listening && !g_interrupted.exchange(true)) return;
  // A terminal that closes may say so twice: the kernel to all in it, the shell to each of its jobs.
  if (g_listening && signal == SIGHUP) return;
  end_by_signal(signal);
}

}  // namespace

void catch_signals() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before = {};
    if (signal == SIGHUP && sigaction(signal, nullptr, &before) == 0 && before.sa_handler == SIG_IGN) continue;
    sigaction(signal, &action, nullptr);
  }
}

Interrupt::Interrupt() { g_listening = true; }
Interrupt::~Interrupt() { g_listening = false; }
const std::atomic<bool>& Interrupt::flag() { return g_interrupted; }

}  // namespace birefit
