#pragma once
// `birefit view IMAGE`: from a picture to a config that can be shown, without writing YAML. Like Session without a word
// of HTTP; every reply is JSON or numbers for one page.

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/kinds/from_image.h"

namespace birefit::view {

/// What the user answered so far.
struct Answers {
  std::string kind;                                     ///< a name of kinds()
  Stated stated;                                        ///< what was drawn and typed about the picture
  std::vector<std::pair<std::string, double>> numbers;  ///< of the sample and the microscope, by path
};

/// An image whose config is still to be found.
class Beginning {
 public:
  /// Throws UserError where the image cannot be read.
  explicit Beginning(std::filesystem::path image);

  /// The file, its size, and the kinds of samples that an image may show.
  std::string description() const;
  /// The image's values as float32, row by row.
  std::string picture() const;
  /// What a kind looks like: a small square picture, made by the program itself, as bytes from black to white; empty
  /// for kinds of which there is none.
  std::string thumbnail(const std::string& kind) const;
  /// The config so far, as `birefit new KIND --image FILE` makes it, what the file told, what is missing, and the
  /// numbers that it takes as known. Throws UserError for an unknown kind.
  std::string grow(const Answers& answers) const;
  /// The config that this text is, beside the image. Throws UserError with every mistake in it.
  Config open(const std::string& text) const;

 private:
  const std::filesystem::path image_;
  LoadedImage loaded_;
  mutable std::mutex guard_;  ///< of thumbnails
  mutable std::vector<std::pair<std::string, std::string>> thumbnails_;
};

}  // namespace birefit::view
