#include "io/images/npy_image.h"

#include <bit>

#include <fmt/format.h>

namespace birefit {

std::string encode_npy(const Image& image) {
  std::string header =
      fmt::format("{{'descr': '{}f8', 'fortran_order': False, 'shape': ({}, {}), }}",
                  std::endian::native == std::endian::little ? '<' : '>', image.height(), image.width());
  // The data start at a multiple of 64 bytes, behind a line end.
  constexpr std::size_t kBefore = 10, kMultiple = 64;
  header.append(kMultiple - 1 - (kBefore + header.size()) % kMultiple, ' ');
  header += '\n';
  std::string file = "\x93NUMPY";
  file += {'\1', '\0', static_cast<char>(header.size() & 255), static_cast<char>(header.size() >> 8)};
  file += header;
  file.append(reinterpret_cast<const char*>(image.values().data()), sizeof(double) * image.size());
  return file;
}

}  // namespace birefit
