#pragma once
// Arrays as numpy.save writes them.
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace birefit {

/// What begins every such file.
constexpr std::string_view kNpyMagic = "\x93NUMPY";

/// What a file says of its array.
struct NpyHeader {
  std::vector<std::size_t> shape;
  std::string shape_text;  ///< "(480, 640)"
  std::size_t bytes = 8;   ///< of a number
  char kind = 'f';         ///< NumPy's: floats, u and i integers, b truth values
  bool fortran = false;    ///< the first index runs fastest
  bool swapped = false;    ///< its byte order is the other one
  std::size_t start = 0;   ///< of the numbers in the file

  /// How many numbers the shape says there are; at most as many as a double counts.
  double count() const;
  /// The number whose bytes begin here.
  double number(const char* from) const;
};

/// Throws: what was found, and what to do.
using NpyRefusal = std::function<void(const std::string& found, const std::string& hint)>;

/// The header of a file that begins so; `beginning` may be all of it. Refuses what is no array of numbers, and complex
/// ones.
NpyHeader npy_header(std::string_view beginning, const NpyRefusal& refuse);
/// Refuses a file of this size, in bytes, if the shape needs another.
void check_npy_size(const NpyHeader& header, std::size_t size, const NpyRefusal& refuse);

}  // namespace birefit
