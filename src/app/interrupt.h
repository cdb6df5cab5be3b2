#pragma once
// Ctrl-C: the first ends the work with what it has, a second one ends the program.

#include <atomic>

namespace birefit {

/// While one lives, Ctrl-C sets `flag()` in place of ending the program.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  static const std::atomic<bool>& flag();
};

}  // namespace birefit
