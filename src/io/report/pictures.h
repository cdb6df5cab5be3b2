#pragma once
// A report's sections of what was measured and fitted: pictures, profiles through them, tables of signals.

#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit::page {

/// Everything the report needs of one micrograph, whatever part of it is there.
struct Frame {
  const MicrographResult* result = nullptr;
  const Picture* input = nullptr;
  const Scene* scene = nullptr;
  Image measured;
  Image normalised;  ///< residual / sigma; NaN where not used
  Mask used;         ///< pixels of the fit
  std::string unit;  ///< of the values
};

/// None of a fit to tables: images of one pixel show nothing.
std::vector<Frame> frames_of(const Config& config, const FitResult& result);
/// `figure`: the number of the next one. `largest_side`: of its pictures, pixels.
std::string frame_section(const Frame& frame, const FitResult& result, int& figure, int largest_side);
/// Measured and fitted signal of one table against its first column.
std::string signal_section(const SignalTable& table, const FitResult& result, int& figure);

}  // namespace birefit::page
