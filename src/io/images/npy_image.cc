#include "io/images/npy_image.h"

#include <bit>

#include <fmt/format.h>

namespace birefit {

std::string encode_npy(std::span<const Image> channels) {
  const Image& first = channels.front();
  const bool one = channels.size() == 1;
  std::string header = fmt::format("{{'descr': '{}f8', 'fortran_order': False, 'shape': ({}, {}{}), }}",
                                   std::endian::native == std::endian::little ? '<' : '>', first.height(),
                                   first.width(), one ? "" : fmt::format(", {}", channels.size()));
  // The data start at a multiple of 64 bytes, behind a line end.
  constexpr std::size_t kBefore = 10, kMultiple = 64;
  header.append(kMultiple - 1 - (kBefore + header.size()) % kMultiple, ' ');
  header += '\n';
  std::string file = "\x93NUMPY";
  file += {'\1', '\0', static_cast<char>(header.size() & 255), static_cast<char>(header.size() >> 8)};
  file += header;
  const auto append = [&](const double* values, std::size_t count) {
    file.append(reinterpret_cast<const char*>(values), sizeof(double) * count);
  };
  if (one) {
    append(first.values().data(), first.size());
    return file;
  }
  for (std::size_t i = 0; i < first.size(); ++i)
    for (const Image& channel : channels) append(&channel.values()[i], 1);
  return file;
}

}  // namespace birefit
