#pragma once
// Whole files, written completely or not at all. Private to io.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "birefit/image.h"

namespace birefit {

struct FileContent {
  std::filesystem::path path;
  std::string content;
};

/// Writes every file under a temporary name in its folder and renames only when all of them are on disk: a full disk or
/// a Ctrl-C leaves the files of an earlier run as they were. What is `outdated` is removed before. Throws UserError; no
/// temporary survives it.
void write_files(const std::vector<FileContent>& files, const std::vector<std::filesystem::path>& outdated = {});

/// What save_image would write, and .npy (float64): the format follows from the extension of `path`. TIFFs state the
/// pixel size (0: not known).
std::string encode_image(const Image& image, const std::filesystem::path& path, double pixel_size_um = 0);
/// The same of one channel or of red, green and blue, of one size.
std::string encode_channels(std::span<const Image> channels, const std::filesystem::path& path,
                            double pixel_size_um = 0);

/// Ends the program by this signal, but never with half a file behind: at once, or as soon as what is being written
/// has its final name. Safe in a signal handler.
void end_by_signal(int signal);

}  // namespace birefit
