#pragma once
// Files that are read whole, as far as they may be large.

#include <cstdint>
#include <filesystem>
#include <string>

#include "birefit/error.h"

namespace birefit {

/// All bytes of a file or pipe. Throws UserError at `where`, about `subject` ("" where the place is the file itself):
/// cannot be read, or is larger than `most_mb` MB (then with `hint`).
std::string read_whole(const std::filesystem::path& path, std::uintmax_t most_mb, const Where& where,
                       const std::string& subject, const std::string& hint);

/// SHA-256 of bytes, as 64 hexadecimal digits.
std::string sha256(const std::string& bytes);
/// The same of a file's content; "" where it cannot be read.
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace birefit
