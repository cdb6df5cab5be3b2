#include "app/interrupt.h"

#include <csignal>

namespace birefit {
namespace {

std::atomic<bool> g_interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

void on_interrupt(int) {
  g_interrupted = true;
  std::signal(SIGINT, SIG_DFL);
}

}  // namespace

Interrupt::Interrupt() { std::signal(SIGINT, on_interrupt); }
Interrupt::~Interrupt() { std::signal(SIGINT, SIG_DFL); }
const std::atomic<bool>& Interrupt::flag() { return g_interrupted; }

}  // namespace birefit
