#include "io/libraries/raw_photograph.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include <OpenImageIO/imageio.h>

namespace birefit {

bool is_raw_photograph(const TiffTags& tags) {
  if (tags.pages.empty()) return false;
  const TiffDirectory& first = tags.pages.front();
  const auto filtered = [](const TiffDirectory& directory) {
    return directory.photometric == kCfaPhotometric || directory.photometric == kLinearRawPhotometric;
  };
  const bool any_filtered = filtered(first) || std::any_of(tags.children.begin(), tags.children.end(), filtered);
  const bool of_a_camera = first.dng || !first.children.empty();
  return tags.canon_raw || (of_a_camera && (first.reduced() || any_filtered));
}

std::optional<RawPhotograph> read_raw_photograph(const std::filesystem::path& path) {
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create("raw");
  if (!input) {
    (void)OIIO::geterror();
    return std::nullopt;
  }
  OIIO::ImageSpec settings, spec;
  settings.attribute("raw:Demosaic", "none");
  settings.attribute("raw:user_flip", 0);
  const bool open = input->open(path.string(), spec, settings) && spec.nchannels == 1 && spec.width > 0 &&
                    spec.height > 0 && spec.format == OIIO::TypeDesc::UINT16;
  std::vector<std::uint16_t> samples;
  if (open) samples.resize(static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height));
  const bool read = open && input->read_scanlines(0, 0, 0, spec.height, 0, 0, 1, spec.format, samples.data());
  (void)input->geterror();
  if (!read) return std::nullopt;
  RawPhotograph raw;
  raw.counts = Image(spec.width, spec.height);
  std::copy(samples.begin(), samples.end(), raw.counts.values().begin());
  // LibRaw's letters go round the cell: two of a row, then two of the next, the second pair from behind.
  static const std::map<std::string, std::string> kPatterns = {
      {"RGBG", "rggb"}, {"BGRG", "bggr"}, {"GRGB", "grbg"}, {"GBGR", "gbrg"}};
  const auto pattern = kPatterns.find(spec.get_string_attribute("raw:FilterPattern", ""));
  if (pattern != kPatterns.end()) raw.pattern = pattern->second;
  return raw;
}

}  // namespace birefit
