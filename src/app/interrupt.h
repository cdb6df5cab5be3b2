#pragma once
// Ctrl-C, SIGTERM (a scheduler, a shutdown) and SIGHUP (a terminal that closes): the first ends the work with what it
// has, a second one ends the program.

#include <atomic>

namespace birefit {

/// From here on none of these signals leaves half a file behind. A SIGHUP that is ignored (nohup) stays ignored.
void catch_signals();

/// While one lives, the first of these signals sets `flag()` in place of ending the program.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  static const std::atomic<bool>& flag();
};

}  // namespace birefit
