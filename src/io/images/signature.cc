#include "io/images/signature.h"

#include <array>
#include <cstring>
#include <fstream>
#include <string_view>

namespace birefit {
namespace {

std::uint32_t big_endian(const unsigned char* p) {
  return std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | p[3];
}

void read_png_signature(std::ifstream& file, std::uintmax_t file_size, Signature& signature) {
  std::uintmax_t position = 8;
  bool ended = false;
  while (!ended && position + 12 <= file_size) {
    std::array<unsigned char, 8> head{};
    file.seekg(static_cast<std::streamoff>(position));
    if (!file.read(reinterpret_cast<char*>(head.data()), head.size())) break;
    const std::uint32_t length = big_endian(head.data());
    const std::string type(reinterpret_cast<const char*>(head.data()) + 4, 4);
    if (type == "IHDR" && length >= 13) {
      std::array<unsigned char, 13> header{};
      if (!file.read(reinterpret_cast<char*>(header.data()), header.size())) break;
      signature.stored_bits = header[8];
      signature.palette = header[9] == 3;
    } else if (type == "acTL") {
      signature.animated = true;
    }
    position += std::uintmax_t{12} + length;
    ended = type == "IEND" && position <= file_size;
  }
  signature.truncated = !ended;
}

}  // namespace

Signature read_signature(const std::filesystem::path& path, std::uintmax_t file_size) {
  Signature signature;
  std::ifstream file(path, std::ios::binary);
  std::array<unsigned char, 32> head{};
  file.read(reinterpret_cast<char*>(head.data()), head.size());
  const std::size_t count = static_cast<std::size_t>(file.gcount());
  file.clear();
  const auto starts_with = [&](std::string_view bytes, std::size_t at = 0) {
    return count >= at + bytes.size() && std::memcmp(head.data() + at, bytes.data(), bytes.size()) == 0;
  };
  using namespace std::string_view_literals;
  if (starts_with("\x89PNG\r\n\x1a\n"sv)) {
    signature = {"png", "PNG"};
    read_png_signature(file, file_size, signature);
  } else if (starts_with("II*\0"sv) || starts_with("MM\0*"sv) || starts_with("II+\0"sv) || starts_with("MM\0+"sv)) {
    signature = {"tiff", "TIFF"};
  } else if (starts_with("FUJIFILMCCD-RAW"sv) || starts_with("ftypcrx "sv, 4) || starts_with("IIRO"sv) ||
             starts_with("IIRS"sv) || starts_with("MMOR"sv) || starts_with("IIU\0"sv) || starts_with("\0MRM"sv) ||
             starts_with("FOVb"sv)) {
    signature = {"raw", "raw photograph"};  // Fujifilm, Canon, Olympus, Panasonic, Minolta, Sigma; others are TIFFs
  } else if (starts_with("v/1\x01"sv)) {
    signature = {"openexr", "OpenEXR"};
  } else if (starts_with("\xff\xd8\xff"sv)) {
    signature = {"jpeg", "JPEG"};
    signature.stored_bits = 8;
    signature.lossy = true;
  } else if (starts_with("GIF8"sv)) {
    signature = {"gif", "GIF"};
    signature.palette = true;
  } else if (starts_with("RIFF"sv) && starts_with("WEBP"sv, 8)) {
    signature = {"webp", "WebP"};
    signature.stored_bits = 8;
    signature.lossy = !starts_with("VP8L"sv, 12);
    signature.animated = starts_with("VP8X"sv, 12) && (head[20] & 0x02) != 0;
  } else if (starts_with("BM"sv) && count >= 30) {
    signature = {"bmp", "BMP"};
    signature.stored_bits = head[28] | head[29] << 8;
    signature.palette = signature.stored_bits <= 8;
  }
  return signature;
}

}  // namespace birefit
