#pragma once
// Which page of a stack is which: by their numbers, and by the places along t, z and c that ImageJ's and OME's metadata
// give them.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace birefit {

/// A page of a file. Places count from 0; they are stated only along what the stack has more than one of.
struct StackPage {
  std::optional<int> number;  ///< from 0; none where the file has no other
  std::optional<int> t, z, c;

  /// "t2_c0"; "p3" where no place is stated.
  std::string label() const;
};

/// The pages of a TIFF file but for reduced copies of others, as far as its chain can be read; the pictures of an array
/// (.npy); of any other file one without a number.
std::vector<StackPage> stack_pages(const std::filesystem::path& file);

}  // namespace birefit
