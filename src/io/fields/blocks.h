#pragma once
// Packed bytes: base64, and the compressed blocks of VTK and of zip archives.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace birefit::fields {

/// Bytes of base64 from the start of `text` on, until `bytes` are there or the text ends; parts may each be padded.
std::string base64_bytes(std::string_view text, std::size_t bytes);

/// How many characters of base64, padded, `bytes` take.
constexpr std::size_t base64_length(std::size_t bytes) { return (bytes + 2) / 3 * 4; }

enum class Packing { zlib, raw_deflate, lz4, lzma };

/// The unpacked bytes, exactly so many; nothing where they are damaged or of another length.
std::optional<std::string> unpacked(std::string_view packed, std::size_t bytes, Packing packing);

}  // namespace birefit::fields
