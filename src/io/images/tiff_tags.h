#pragma once
// The directories of a TIFF file as they stand in it: OpenImageIO neither applies the format's default of one bit per
// sample, nor tells a raw photograph's thumbnail from its picture.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace birefit {

/// One directory: a picture with its tags, absent ones at the default that the format gives them.
struct TiffDirectory {
  std::uint64_t offset = 0, link = 0;  ///< where it starts, and where its offset stands
  std::uint64_t width = 0, height = 0;
  int bits = 1, samples = 1, photometric = 1, subfile = 0;
  bool states_bits = false;
  bool dng = false;  ///< has a DNGVersion
  bool reduced() const { return (subfile & 1) != 0; }
  std::string description;              ///< ImageDescription, of the chain's first page alone
  std::string pattern;                  ///< of colour filters in cells of 2 x 2: "rggb", ..
  std::vector<std::uint64_t> children;  ///< offsets of its SubIFDs
  std::uint64_t stack_planes = 1;       ///< of MetaMorph (UIC2Tag): planes that this one directory stands for
};

struct TiffTags {
  bool big_endian = false, big_tiff = false;
  bool canon_raw = false;               ///< "CR" behind the header
  std::vector<TiffDirectory> pages;     ///< the chain, as far as it was asked for
  bool cut_off = false;                 ///< the chain goes on behind the end of the file
  std::vector<TiffDirectory> children;  ///< SubIFDs of the first page
};

constexpr int kCfaPhotometric = 32803, kLinearRawPhotometric = 34892;  // TIFF/EP, DNG

/// At most `most_pages` directories of the chain; fewer where the file is damaged, none where it is no TIFF.
TiffTags read_tiff_tags(const std::filesystem::path& path, std::size_t most_pages);

/// The file with BitsPerSample = 1 written out in a page that leaves it to the default, at the end of the file: for
/// readers that take the default to be 8. Empty for BigTIFF and for files too large to hold (2 GB).
std::string with_stated_bit(const std::filesystem::path& path, const TiffTags& tags, std::size_t page);

/// The file as if the chain began with this directory: for readers that see no SubIFDs. Empty as above.
std::string beginning_with(const std::filesystem::path& path, const TiffTags& tags, const TiffDirectory& directory);

}  // namespace birefit
