#pragma once
// What a config names and a program has in memory: arrays that are read in place of files.

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace birefit {

/// A picture as another program holds it, read where it lies: rows x columns x channels of one type.
struct ArrayImage {
  /// Of the samples; integers of 8 and 16 bits are counts, and saturate at their top code.
  enum class Sample { uint8, uint16, float32, float64 };
  Sample sample = Sample::float64;
  /// Of samples that were integers of so many bits, 8 or 16, before some became NaN, which no fit uses; 0: of others
  int count_bits = 0;
  int width = 0, height = 0, channels = 1;                            ///< three or four channels: r, g, b, alpha
  std::ptrdiff_t row_bytes = 0, column_bytes = 0, channel_bytes = 0;  ///< from one to the next; any sign
  const void* first = nullptr;                                        ///< sample of row 0, column 0, channel 0
  std::shared_ptr<const void> owner;                                  ///< keeps the samples where they are
};

/// Arrays by the names that a config gives where it would name files. Whoever reads the config reads these where a name
/// is one of theirs, and files else.
struct InMemory {
  std::map<std::string, ArrayImage> images;  ///< micrographs, calibration frames and masks
  /// what a file of numpy.save or numpy.savez would hold: director fields
  std::map<std::string, std::shared_ptr<const std::string>> fields;
};

}  // namespace birefit
