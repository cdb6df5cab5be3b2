#pragma once
// The page's files, which the build puts into the program (src/view/embed.cmake).

#include <span>
#include <string_view>

namespace birefit::view {

struct PageFile {
  std::string_view name, content;
};

std::span<const PageFile> page_files();

}  // namespace birefit::view
