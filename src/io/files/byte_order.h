#pragma once
// Numbers in files of either byte order.

#include <array>
#include <cstddef>
#include <cstring>

namespace birefit {

/// The number whose bytes begin here; `swapped`: in the other order.
template <class T>
T read_as(const char* from, bool swapped = false) {
  std::array<char, sizeof(T)> bytes;
  for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = from[swapped ? sizeof(T) - 1 - i : i];
  T value;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

}  // namespace birefit
