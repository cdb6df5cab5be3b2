#pragma once
// What the first bytes of a file say, and facts that OpenImageIO does not pass on. Only the formats named here are
// opened: the type follows from the content, so that a wrong extension neither confuses nor hands an untrusted file to
// some rarely used decoder.

#include <cstdint>
#include <filesystem>
#include <string>

namespace birefit {

struct Signature {
  std::string format;       ///< OpenImageIO's name; "" = none of ours
  std::string format_name;  ///< for people
  int stored_bits = 0;      ///< per sample or palette index, when the header says; 0 = ask OpenImageIO
  bool palette = false;
  bool animated = false;
  bool truncated = false;
  bool lossy = false;
};

Signature read_signature(const std::filesystem::path& path, std::uintmax_t file_size);

}  // namespace birefit
