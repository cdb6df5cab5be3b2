#include "io/fields/blocks.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>

#include <lz4.h>
#include <lzma.h>
#include <zlib.h>

namespace birefit::fields {
namespace {

bool inflated(std::string_view packed, std::string& out, int window_bits) {
  z_stream stream{};
  if (::inflateInit2(&stream, window_bits) != Z_OK) return false;
  // zlib counts in 32 bits; input and output are handed over in parts.
  constexpr std::size_t kPart = 1u << 30;
  std::size_t taken = 0, given = 0;
  int state = Z_OK;
  while (state == Z_OK) {
    if (stream.avail_in == 0 && taken < packed.size()) {
      const std::size_t part = std::min(kPart, packed.size() - taken);
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + taken));
      stream.avail_in = static_cast<uInt>(part);
      taken += part;
    }
    if (stream.avail_out == 0 && given < out.size()) {
      const std::size_t part = std::min(kPart, out.size() - given);
      stream.next_out = reinterpret_cast<Bytef*>(out.data() + given);
      stream.avail_out = static_cast<uInt>(part);
      given += part;
    }
    state = ::inflate(&stream, Z_NO_FLUSH);
    if (stream.avail_in == 0 && taken == packed.size() && state == Z_OK && stream.avail_out > 0) break;
    if (stream.avail_out == 0 && given == out.size() && state == Z_OK) {
      Bytef more = 0;  // the end mark may be still to come, more bytes may not
      stream.next_out = &more, stream.avail_out = 1;
      state = ::inflate(&stream, Z_NO_FLUSH);
      if (stream.avail_out == 0) state = Z_DATA_ERROR;
      stream.avail_out = 0;
      break;
    }
  }
  ::inflateEnd(&stream);
  return state == Z_STREAM_END && given == out.size() && stream.avail_out == 0;
}

}  // namespace

/// Bytes of base64 from `from` on, until `bytes` are there or the text ends; length and data may each be padded.
std::string base64_bytes(std::string_view text, std::size_t bytes) {
  std::string out;
  unsigned group = 0;
  int digits = 0, padding = 0;
  for (char c : text) {
    if (out.size() >= bytes) break;
    int digit;
    if (c >= 'A' && c <= 'Z')
      digit = c - 'A';
    else if (c >= 'a' && c <= 'z')
      digit = c - 'a' + 26;
    else if (c >= '0' && c <= '9')
      digit = c - '0' + 52;
    else if (c == '+')
      digit = 62;
    else if (c == '/')
      digit = 63;
    else if (c == '=')
      digit = 0, ++padding;
    else if (c == ' ' || c == '\n' || c == '\r' || c == '\t')
      continue;
    else
      break;
    group = group << 6 | static_cast<unsigned>(digit);
    if (++digits < 4) continue;
    for (int k = 0; k < 3 - padding; ++k) out.push_back(static_cast<char>(group >> (16 - 8 * k) & 255));
    group = 0;
    digits = padding = 0;
  }
  return out;
}

std::optional<std::string> unpacked(std::string_view packed, std::size_t bytes, Packing packing) {
  // What no format packs so tightly is a damaged length (deflate: 1032 times at most), not a reason to take memory.
  constexpr std::size_t kTightest = 2000;
  if (packing != Packing::lzma && bytes / kTightest > packed.size() + 16) return std::nullopt;
  std::string out(bytes, '\0');
  switch (packing) {
    case Packing::zlib:
    case Packing::raw_deflate:
      if (!inflated(packed, out, packing == Packing::zlib ? MAX_WBITS : -MAX_WBITS)) return std::nullopt;
      return out;
    case Packing::lz4: {
      constexpr std::size_t kMost = std::numeric_limits<int>::max();
      if (packed.size() > kMost || bytes > kMost) return std::nullopt;
      const int count =
          ::LZ4_decompress_safe(packed.data(), out.data(), static_cast<int>(packed.size()), static_cast<int>(bytes));
      if (count < 0 || static_cast<std::size_t>(count) != bytes) return std::nullopt;
      return out;
    }
    case Packing::lzma: {
      std::uint64_t memory = std::uint64_t{1} << 30;  // the largest dictionary anyone writes takes less
      std::size_t from = 0, to = 0;
      const lzma_ret end =
          ::lzma_stream_buffer_decode(&memory, 0, nullptr, reinterpret_cast<const std::uint8_t*>(packed.data()), &from,
                                      packed.size(), reinterpret_cast<std::uint8_t*>(out.data()), &to, out.size());
      if (end != LZMA_OK || to != bytes) return std::nullopt;
      return out;
    }
  }
  return std::nullopt;
}

}  // namespace birefit::fields
