#include "io/images/npy_image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>

#include <fmt/format.h>

#include "io/images/asked.h"
#include "io/images/npy_array.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostChannels = 4;  // more along the last index are the columns of a stack

/// The indices of an array that is a picture, or several: of what it has one only the file need not have an index.
struct Axes {
  std::size_t pictures = 1, rows = 0, columns = 0, channels = 1;

  /// Where a number stands among all of them.
  std::size_t at(std::size_t picture, std::size_t row, std::size_t column, std::size_t channel, bool fortran) const {
    return fortran ? picture + pictures * (row + rows * (column + columns * channel))
                   : ((picture * rows + row) * columns + column) * channels + channel;
  }
};

std::optional<Axes> axes_of(const std::vector<std::size_t>& shape) {
  const std::size_t n = shape.size();
  if (n < 2 || n > 4) return std::nullopt;
  if (n == 2) return Axes{1, shape[0], shape[1], 1};
  const bool coloured = shape[n - 1] <= kMostChannels;
  if (n == 3) return coloured ? Axes{1, shape[0], shape[1], shape[2]} : Axes{shape[0], shape[1], shape[2], 1};
  return coloured ? std::optional(Axes{shape[0], shape[1], shape[2], shape[3]}) : std::nullopt;
}

/// Enough of an array for its header, which has a few hundred bytes; of any other file no more than tells.
std::string beginning_of(const fs::path& path) {
  constexpr std::size_t kMost = 1 << 17;
  std::ifstream file(path, std::ios::binary);
  std::string bytes;
  for (const std::size_t size : {kNpyMagic.size(), kMost}) {
    const std::size_t there = bytes.size();
    bytes.resize(size);
    file.read(bytes.data() + there, static_cast<std::streamsize>(size - there));
    bytes.resize(there + static_cast<std::size_t>(file.gcount()));
    if (bytes != kNpyMagic) break;
  }
  return bytes;
}

/// The picture that is asked for, or the only one.
std::size_t picture_asked(const ImageRequest& request, std::size_t pictures) {
  if (pictures > 1 && !request.page)
    refuse_image(request, fmt::format("has {} pictures, each of an index of its array, and none is chosen", pictures),
                 "add `page: 0` for the first; micrographs: {files: ..} takes each as an image");
  const int page = request.page.value_or(0);
  if (page < 0 || static_cast<std::size_t>(page) >= pictures)
    refuse_image(request,
                 fmt::format("has no page {}: it has {}", page,
                             pictures == 1 ? std::string("1 picture") : fmt::format("{} pictures", pictures)),
                 "pages count from 0");
  return static_cast<std::size_t>(page);
}

/// What the codes of these numbers are.
void settle_codes(const ImageRequest& request, const NpyHeader& header, LoadedImage& loaded) {
  if (header.kind == 'b' && !request.mask)
    refuse_image(request, "holds truth values: black and white carry no intensities", "save the original grey image");
  const bool counts = header.kind == 'u' && header.bytes <= 2, of_bits = header.kind == 'b';
  loaded.bits = counts || of_bits ? static_cast<int>(header.bytes) * 8 : 32;
  loaded.top_code = of_bits ? 1 : counts ? std::exp2(loaded.bits) - 1 : 0;
  if (!counts && !of_bits && header.kind != 'f')
    loaded.notes.push_back(fmt::format("{}-bit {}integer: read as float, the saturation code is not known",
                                       8 * header.bytes, header.kind == 'i' ? "signed " : ""));
  if (header.kind == 'f' && header.bytes == 2)
    loaded.notes.push_back("16-bit float samples hold three decimal digits only");
}

/// The plain average of channels.
Image read_pixels(const ImageRequest& request, const NpyHeader& header, const Axes& axes, std::size_t picture,
                  const std::vector<int>& channels, const PixelRect& part) {
  std::ifstream file(request.path, std::ios::binary);
  std::string bytes;
  // Numbers `first` to `end` of the file.
  const auto fetch = [&](std::size_t first, std::size_t end) {
    bytes.resize((end - first) * header.bytes);
    file.seekg(static_cast<std::streamoff>(header.start + first * header.bytes));
    if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size())))
      refuse_image(request, "cannot be read to its end", "copy it again from its source");
  };
  const auto column = [](int x) { return static_cast<std::size_t>(x); };
  std::size_t first = 0;
  if (header.fortran) fetch(0, static_cast<std::size_t>(header.count()));
  const double weight = 1.0 / static_cast<double>(channels.size());
  Image values(part.width(), part.height());
  for (int y = part.y0; y < part.y1; ++y) {
    const auto row = static_cast<std::size_t>(y);
    if (!header.fortran) {
      first = axes.at(picture, row, column(part.x0), 0, false);
      fetch(first, axes.at(picture, row, column(part.x1), 0, false));
    }
    for (int x = part.x0; x < part.x1; ++x) {
      double sum = 0;
      for (const int channel : channels) {
        const std::size_t at = axes.at(picture, row, column(x), static_cast<std::size_t>(channel), header.fortran);
        sum += header.number(bytes.data() + (at - first) * header.bytes);
      }
      values(x - part.x0, y - part.y0) = channels.size() == 1 ? sum : sum * weight;
    }
  }
  return values;
}

}  // namespace

std::string encode_npy(std::span<const Image> channels) {
  const Image& first = channels.front();
  const bool one = channels.size() == 1;
  std::string header = fmt::format("{{'descr': '{}f8', 'fortran_order': False, 'shape': ({}, {}{}), }}",
                                   std::endian::native == std::endian::little ? '<' : '>', first.height(),
                                   first.width(), one ? "" : fmt::format(", {}", channels.size()));
  // The data start at a multiple of 64 bytes, behind a line end.
  constexpr std::size_t kBefore = 10, kMultiple = 64;
  header.append(kMultiple - 1 - (kBefore + header.size()) % kMultiple, ' ');
  header += '\n';
  std::string file(kNpyMagic);
  file += {'\1', '\0', static_cast<char>(header.size() & 255), static_cast<char>(header.size() >> 8)};
  file += header;
  const auto append = [&](const double* values, std::size_t count) {
    file.append(reinterpret_cast<const char*>(values), sizeof(double) * count);
  };
  if (one) {
    append(first.values().data(), first.size());
    return file;
  }
  for (std::size_t i = 0; i < first.size(); ++i)
    for (const Image& channel : channels) append(&channel.values()[i], 1);
  return file;
}

std::size_t npy_pictures(const fs::path& file) {
  const std::string beginning = beginning_of(file);
  if (!beginning.starts_with(kNpyMagic)) return 0;
  try {
    const NpyHeader header = npy_header(beginning, [&](const std::string& found, const std::string& hint) {
      throw UserError({file.string()}, found, hint);
    });
    const std::optional<Axes> axes = axes_of(header.shape);
    return axes && header.kind != 'b' ? axes->pictures : 0;
  } catch (const UserError&) {  // load_npy says so, where it is asked for
    return 0;
  }
}

LoadedImage load_npy(const ImageRequest& request) {
  const NpyRefusal refuse = [&](const std::string& found, const std::string& hint) {
    refuse_image(request, found, hint);
  };
  const NpyHeader header = npy_header(beginning_of(request.path), refuse);
  const std::optional<Axes> axes = axes_of(header.shape);
  if (!axes)
    refuse_image(request, "is an array of the shape " + (header.shape_text.empty() ? "()" : header.shape_text),
                 "(rows, columns) is a picture, (rows, columns, 3) one in colours, (pictures, rows, columns) a stack");
  if (header.count() == 0) refuse_image(request, "is an array without pixels", "(rows, columns)");
  constexpr std::size_t kMost = 1 << 30;
  check_image_size(request, static_cast<int>(std::min(axes->columns, kMost)),
                   static_cast<int>(std::min(axes->rows, kMost)));
  check_npy_size(header, fs::file_size(request.path), refuse);
  const std::size_t picture = picture_asked(request, axes->pictures);
  LoadedImage loaded;
  settle_codes(request, header, loaded);
  const std::vector<int> channels = channels_asked(request, channels_of_array(axes->channels), false, loaded.notes);
  loaded.width = static_cast<int>(axes->columns), loaded.height = static_cast<int>(axes->rows);
  loaded.colour = axes->channels >= 3;
  const PixelRect part = part_asked(request, loaded.width, loaded.height);
  loaded.x0 = part.x0, loaded.y0 = part.y0;
  if (part.width() > 0) loaded.values = read_pixels(request, header, *axes, picture, channels, part);
  return loaded;
}

}  // namespace birefit
