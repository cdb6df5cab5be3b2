#pragma once
// Whole files, written completely or not at all. Private to io.

#include <filesystem>
#include <string>
#include <vector>

#include "birefit/image.h"

namespace birefit {

struct FileContent {
  std::filesystem::path path;
  std::string content;
};

/// Writes every file under a temporary name in its folder and renames only when all of them are on disk: a full disk or
/// a Ctrl-C leaves the files of an earlier run as they were. Throws UserError; no temporary survives it.
void write_files(const std::vector<FileContent>& files);

/// What save_image would write: the format follows from the extension of `path`.
std::string encode_image(const Image& image, const std::filesystem::path& path);

}  // namespace birefit
