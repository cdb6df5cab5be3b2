#pragma once
// `page:` of a config: by number, or by its place along t, z and c of a stack.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/config/reader.h"
#include "io/images/pages.h"

namespace birefit {

/// Which page of a file, or which pages of a stack; each counts from 0.
struct PageChoice {
  std::optional<int> number, t, z, c;
  Where where;

  bool places() const { return t || z || c; }
  bool given() const { return number || places(); }
  bool lets_through(const StackPage& page) const;
  /// "page 3", "t 2, c 0".
  std::string words() const;
};

/// `page: 3` or `page: {t: 2, c: 0}`; nothing chosen without the key.
PageChoice read_page(ConfigReader& reader, const Block& block);

/// Places along t, z and c as the number of the one page that is there. False, with a problem, where it is not one.
bool settle_page(ConfigReader& reader, const std::filesystem::path& file, PageChoice& choice);

}  // namespace birefit
