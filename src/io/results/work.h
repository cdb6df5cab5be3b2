#pragma once
// The user's errors that only show in the work: what has no place gets one, and too little memory says what is needed.

#include <new>
#include <string>

#include "birefit/io.h"

namespace birefit {

/// "40 s", "3 min", "2.5 h".
std::string describe_duration(double seconds);

/// Bytes at most, about: of the picture and of what is written of it.
double memory_to_render(const Scene& scene);
/// The same of a fit: pictures, their derivatives, what is written.
double memory_to_fit(const FitJob& job);
/// "2.1 GB".
std::string describe_memory(double bytes);
/// "40 s", "3 min", "2.5 h".
std::string describe_duration(double seconds);

/// Throws UserError where this machine, or what this process may have of it, is smaller than `bytes`.
void check_memory(const Config& config, double bytes);
UserError too_little_memory(const Config& config, double bytes);
/// The same errors; those without a place have that of the config's pictures or tables.
UserError with_place(const UserError& error, const Config& config);

/// work(), which takes about `bytes`: its UserErrors have a place, and where memory ends it is one of them.
template <class Work>
auto do_placed(const Config& config, double bytes, const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw too_little_memory(config, bytes);
  } catch (const UserError& error) {
    throw with_place(error, config);
  }
}
/// The same; not begun where this machine has too little memory.
template <class Work>
auto do_work(const Config& config, double bytes, const Work& work) {
  check_memory(config, bytes);
  return do_placed(config, bytes, work);
}

/// What a config's job comes to, by its own options: the fit of `birefit fit`, with what rows of tables say of
/// themselves among its warnings.
FitResult fit_config(const Config& config);

}  // namespace birefit
