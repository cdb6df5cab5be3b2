#include "io/files/array_image.h"

#include <cstring>

#include "io/files/whole_file.h"
#include "io/images/asked.h"

namespace birefit {
namespace {

const char* place_of(const ArrayImage& array, int column, int row, int channel) {
  return static_cast<const char*>(array.first) + row * array.row_bytes + column * array.column_bytes +
         channel * array.channel_bytes;
}

/// Calls with(T{}) for the type of the samples.
template <class With>
void by_sample(ArrayImage::Sample sample, With&& with) {
  switch (sample) {
    case ArrayImage::Sample::uint8:
      return with(std::uint8_t{});
    case ArrayImage::Sample::uint16:
      return with(std::uint16_t{});
    case ArrayImage::Sample::float32:
      return with(float{});
    case ArrayImage::Sample::float64:
      return with(double{});
  }
}

/// The plain average of channels, as files are read (io/libraries/image_file.cc).
template <class T>
void read_samples(const ArrayImage& array, const std::vector<int>& channels, const PixelRect& part, Image& values) {
  const double weight = 1.0 / static_cast<double>(channels.size());
  for (int y = 0; y < part.height(); ++y)
    for (int x = 0; x < part.width(); ++x) {
      double sum = 0;
      for (const int channel : channels) {
        T sample;  // may lie anywhere
        std::memcpy(&sample, place_of(array, part.x0 + x, part.y0 + y, channel), sizeof(T));
        sum += static_cast<double>(sample);
      }
      values(x, y) = channels.size() == 1 ? sum : sum * weight;
    }
}

}  // namespace

LoadedImage load_array(const ImageRequest& request, const ArrayImage& array) {
  if (array.width < 1 || array.height < 1) refuse_image(request, "is an array without pixels", "(rows, columns)");
  check_image_size(request, array.width, array.height);
  if (request.page.value_or(0) > 0)
    refuse_image(request, "is an array, which has no pages", "pass the page that is meant, and leave `page` out");
  LoadedImage loaded;
  const std::vector<int> channels =
      channels_asked(request, channels_of_array(static_cast<std::size_t>(array.channels)), false, loaded.notes);
  const PixelRect part = part_asked(request, array.width, array.height);
  loaded.width = array.width, loaded.height = array.height;
  loaded.x0 = part.x0, loaded.y0 = part.y0;
  loaded.colour = array.channels >= 3;
  const bool counts =
      array.sample == ArrayImage::Sample::uint8 || array.sample == ArrayImage::Sample::uint16 || array.count_bits > 0;
  loaded.bits = array.sample == ArrayImage::Sample::uint8 || array.count_bits == 8 ? 8 : counts ? 16 : 32;
  loaded.top_code = !counts ? 0 : loaded.bits == 8 ? 255 : 65535;
  if (part.width() == 0) return loaded;
  loaded.values = Image(part.width(), part.height());
  by_sample(array.sample, [&](auto zero) { read_samples<decltype(zero)>(array, channels, part, loaded.values); });
  return loaded;
}

std::string sha256(const ArrayImage& array) {
  std::string bytes;
  by_sample(array.sample, [&](auto zero) {
    bytes.reserve(sizeof zero * array.width * array.height * array.channels);
    for (int y = 0; y < array.height; ++y)
      for (int x = 0; x < array.width; ++x)
        for (int c = 0; c < array.channels; ++c) bytes.append(place_of(array, x, y, c), sizeof zero);
  });
  return sha256(bytes);
}

}  // namespace birefit
