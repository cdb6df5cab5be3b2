#include "io/images/pages.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include <pugixml.hpp>

#include "io/images/npy_image.h"
#include "io/images/stated_size.h"
#include "io/images/tiff_tags.h"

namespace birefit {
namespace {

constexpr std::size_t kMostPages = 65536;

/// The sizes of a stack along three axes, the fastest first, named by 'T', 'Z' and 'C'.
struct StackAxes {
  std::array<char, 3> name{};
  std::array<int, 3> size{1, 1, 1};

  std::size_t planes() const { return std::size_t(size[0]) * std::size_t(size[1]) * std::size_t(size[2]); }

  /// Gives a page the places of a plane, counted through the stack.
  void place(std::size_t plane, StackPage& page) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto size_k = static_cast<std::size_t>(size[k]);
      if (size_k > 1) (name[k] == 'T' ? page.t : name[k] == 'Z' ? page.z : page.c) = static_cast<int>(plane % size_k);
      plane /= size_k;
    }
  }
};

/// A count within what a stack can have, 1 where there is none.
int count_of(double value) { return value >= 1 && value <= double(kMostPages) ? static_cast<int>(value) : 1; }

/// `images`: how many there should be; of a file that was cut off there are fewer.
void place_by_imagej(const std::string& description, std::size_t images, std::vector<StackPage>& pages) {
  const auto count = [&](const char* key) { return count_of(number_or_zero(imagej_value(description, key))); };
  const StackAxes axes{{'C', 'Z', 'T'}, {count("channels"), count("slices"), count("frames")}};
  if (axes.planes() != images) return;
  for (std::size_t i = 0; i < pages.size(); ++i) axes.place(i, pages[i]);
}

/// The one element `Pixels` of a description; of several pictures in a file places do not tell which.
pugi::xml_node only_pixels(const pugi::xml_document& document) {
  const pugi::xpath_node_set found = document.select_nodes("//*[local-name()='Pixels']");
  return found.size() == 1 ? found.first().node() : pugi::xml_node();
}

/// Which planes are on which pages: TiffData of the OME schema. A set of files describes all of them in each.
void place_by_ome(const std::string& description, const std::string& file_name, std::vector<StackPage>& pages) {
  pugi::xml_document document;
  if (!document.load_buffer(description.data(), description.size())) return;
  const pugi::xml_node pixels = only_pixels(document);
  const std::string order = pixels.attribute("DimensionOrder").value();
  if (order.size() != 5) return;
  StackAxes axes{{order[2], order[3], order[4]}, {}};
  const pugi::xml_node channel = pixels.select_node("*[local-name()='Channel']").node();
  const int samples = std::max(channel.attribute("SamplesPerPixel").as_int(1), 1);  // colours of one page
  for (std::size_t k = 0; k < 3; ++k) {
    const int size = count_of(pixels.attribute((std::string("Size") + axes.name[k]).c_str()).as_double());
    axes.size[k] = axes.name[k] == 'C' ? std::max(size / samples, 1) : size;
  }
  const pugi::xpath_node_set blocks = pixels.select_nodes("*[local-name()='TiffData']");
  const auto file_of = [](const pugi::xml_node& block) {
    return std::string(block.select_node("*[local-name()='UUID']").node().attribute("FileName").value());
  };
  std::set<std::string> files;
  for (const pugi::xpath_node& block : blocks) files.insert(file_of(block.node()));
  for (const pugi::xpath_node& found : blocks) {
    const pugi::xml_node block = found.node();
    if (files.size() > 1 && file_of(block) != file_name) continue;  // one file may have been renamed
    std::size_t plane = 0, stride = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const int first = block.attribute((std::string("First") + axes.name[k]).c_str()).as_int(0);
      plane += stride * static_cast<std::size_t>(std::max(first, 0));
      stride *= static_cast<std::size_t>(axes.size[k]);
    }
    const bool one =
        block.attribute("IFD") || block.attribute("FirstT") || block.attribute("FirstZ") || block.attribute("FirstC");
    const int first = std::max(block.attribute("IFD").as_int(0), 0);
    const int count = block.attribute("PlaneCount").as_int(one ? 1 : static_cast<int>(pages.size()));
    for (int i = 0; i < count && plane < axes.planes(); ++i, ++plane)
      for (StackPage& page : pages)
        if (page.number == first + i) axes.place(plane, page);
  }
}

}  // namespace

std::string StackPage::label() const {
  std::string text;
  for (const auto& [name, place] : {std::pair('t', t), std::pair('z', z), std::pair('c', c)})
    if (place) text += (text.empty() ? "" : "_") + (name + std::to_string(*place));
  return text.empty() ? "p" + std::to_string(number.value_or(0)) : text;
}

std::vector<StackPage> stack_pages(const std::filesystem::path& file) {
  std::vector<StackPage> pages;
  if (const std::size_t pictures = std::min(npy_pictures(file), kMostPages); pictures > 1) {
    for (std::size_t i = 0; i < pictures; ++i) pages.push_back({static_cast<int>(i), {}, {}, {}});
    return pages;
  }
  const TiffTags tags = read_tiff_tags(file, kMostPages);
  for (std::size_t i = 0; i < tags.pages.size(); ++i)
    if (!tags.pages[i].reduced()) pages.push_back({static_cast<int>(i), {}, {}, {}});
  if (pages.empty() || tags.canon_raw || tags.pages[0].dng) return {StackPage{}};
  const std::string& description = tags.pages[0].description;
  const double stated = number_or_zero(imagej_value(description, "images"));
  // Its next page is lost, which whoever asks for it will say.
  if (tags.cut_off && (tags.pages.size() > 1 || stated > 1))
    pages.push_back({static_cast<int>(tags.pages.size()), {}, {}, {}});
  if (pages.size() == 1 && tags.pages.size() == 1) return {StackPage{}};
  if (stated > 0)
    place_by_imagej(description, tags.cut_off ? static_cast<std::size_t>(stated) : pages.size(), pages);
  else if (description.find("OME") != std::string::npos)
    place_by_ome(description, file.filename().string(), pages);
  return pages;
}

}  // namespace birefit
