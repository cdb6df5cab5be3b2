#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "birefit/io.h"
#include "io/files/file.h"
#include "io/images/asked.h"
#include "io/images/npy_image.h"
#include "io/images/pages.h"
#include "io/images/signature.h"
#include "io/images/stated_optics.h"
#include "io/images/stated_size.h"
#include "io/images/tiff_tags.h"
#include "io/libraries/raw_photograph.h"
#include "io/libraries/table.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;
using OIIO::TypeDesc;

constexpr int kListedPages = 12;
constexpr int kCountedPages = 1000;            // libtiff walks the chain of pages from its start each time
constexpr std::size_t kBandBytes = 64u << 20;  // read at once; a whole ordinary image

// ---- reading --------------------------------------------------------------------------------------------------------

/// One line of OpenImageIO's messages, fit for the end of a sentence.
std::string decoder_message(OIIO::ImageInput& input) {
  std::string text = input.geterror();
  text = text.substr(0, text.find('\n'));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text.empty() ? text : " (" + text + ")";
}

/// Whole, but stored in a way that the decoder does not know, by what it says.
void refuse_unknown_storage(const ImageRequest& request, const std::string& detail) {
  for (const char* words : {"is not implemented", "not configured", "driver doesn't support"})
    if (detail.find(words) != std::string::npos)
      refuse_image(request, "is compressed in a way that this program cannot read" + detail,
                   "save it without compression, or with LZW or deflate");
  if (detail.find("No support for data format") != std::string::npos)
    refuse_image(request, "has samples of a type that is no picture's, such as 64-bit integers or complex numbers",
                 "save it as 8- or 16-bit integers or float");
}

[[noreturn]] void refuse_damaged(const ImageRequest& request, const Signature& signature, const std::string& detail) {
  refuse_unknown_storage(request, detail);
  refuse_image(request,
               fmt::format("is truncated or damaged: it starts like a {} file but cannot be read completely{}",
                           signature.format_name, detail),
               "copy it again from its source, or export it again");
}

[[noreturn]] void refuse_one_bit(const ImageRequest& request) {
  refuse_image(request, "has 1 bit per pixel: black and white carry no intensities", "export the original grey image");
}

std::string describe_type(const OIIO::ImageSpec& spec) {
  const int bits = spec.get_int_attribute("oiio:BitsPerSample", static_cast<int>(spec.format.size()) * 8);
  const char* kind = spec.format.is_floating_point() ? "float" : spec.format.is_signed() ? "signed integer" : "integer";
  return fmt::format("{}-bit {}", bits, kind);
}

std::string describe_page(const OIIO::ImageSpec& spec) {
  return fmt::format("{} x {}, {} channel{}, {}", spec.width, spec.height, spec.nchannels,
                     spec.nchannels == 1 ? "" : "s", describe_type(spec));
}

int count_pages(OIIO::ImageInput& input) {
  int pages = 1;
  while (pages < kCountedPages && input.seek_subimage(pages, 0)) ++pages;
  (void)input.geterror();  // the failed seek past the last page
  return pages;
}

std::string list_pages(OIIO::ImageInput& input, int pages, const fs::path& file) {
  const std::vector<StackPage> stack = stack_pages(file);
  std::string text;
  for (int page = 0; page < std::min(pages, kListedPages); ++page) {
    const auto of_stack =
        std::find_if(stack.begin(), stack.end(), [&](const StackPage& p) { return p.number == page; });
    const bool placed = of_stack != stack.end() && (of_stack->t || of_stack->z || of_stack->c);
    text += fmt::format("{}{}{}: {}", page ? "; " : "", page, placed ? " (" + of_stack->label() + ")" : "",
                        describe_page(input.spec(page)));
  }
  if (pages > kListedPages)
    text += fmt::format("; ... {}{}", pages - 1, pages == kCountedPages ? " and perhaps more" : "");
  return text;
}

/// The channels of a file, and which of them are asked for.
std::vector<int> chosen_channels(const ImageRequest& request, const OIIO::ImageSpec& spec, bool palette,
                                 std::vector<std::string>& notes) {
  std::vector<StoredChannel> stored;
  for (int c = 0; c < spec.nchannels; ++c)
    stored.push_back({c < static_cast<int>(spec.channelnames.size()) ? spec.channelnames[c] : std::string(),
                      c == spec.alpha_channel || c == spec.z_channel});
  return channels_asked(request, stored, palette, notes);
}

/// What was read at once: these pixels of the file, `channels` samples each.
struct Block {
  std::vector<unsigned char> bytes;
  PixelRect at;
  int channels = 1;
};

/// The pixels of a block that belong to the part of the file whose pixels `values` are. `packed`: what samples that
/// were expanded to fill 8 or 16 bits are multiplied by to be counts again, each rounded by itself; 1: they were not.
template <class T>
void add_samples(const Block& block, const std::vector<int>& offsets, double packed, const PixelRect& part,
                 Image& values) {
  const double weight = 1.0 / static_cast<double>(offsets.size());
  const std::size_t pixel_bytes = sizeof(T) * block.channels;
  for (int y = std::max(block.at.y0, part.y0); y < std::min(block.at.y1, part.y1); ++y) {
    const unsigned char* pixel =
        block.bytes.data() +
        (static_cast<std::size_t>(y - block.at.y0) * block.at.width() + (part.x0 - block.at.x0)) * pixel_bytes;
    double* out = values.row(y - part.y0);
    for (int x = 0; x < values.width(); ++x, pixel += pixel_bytes) {
      double sum = 0;
      for (const int offset : offsets) {
        T sample;
        std::memcpy(&sample, pixel + sizeof(T) * offset, sizeof(T));
        sum += packed == 1 ? static_cast<double>(sample) : std::round(static_cast<double>(sample) * packed);
      }
      out[x] = offsets.size() == 1 ? sum : sum * weight;
    }
  }
}

Image read_samples(const ImageRequest& request, const Signature& signature, OIIO::ImageInput& input, int page,
                   const OIIO::ImageSpec& spec, const std::vector<int>& channels, double packed,
                   const PixelRect& part) {
  if (part.width() == 0) return {};
  const int first = *std::min_element(channels.begin(), channels.end());
  const int last = *std::max_element(channels.begin(), channels.end()) + 1;
  std::vector<int> offsets;
  for (const int channel : channels) offsets.push_back(channel - first);
  // The file's own type, so that OpenImageIO has nothing to scale; half becomes float without loss.
  const bool half = spec.format == TypeDesc::HALF || !spec.channelformats.empty();
  const TypeDesc type = half ? TypeDesc(TypeDesc::FLOAT) : spec.format;

  // Whole tiles, or whole rows, that hold the part. Of 64 bits OpenImageIO (2.4) hands out whole pages of strips right,
  // parts of them as zeros and tiles as whatever memory held, and reports success.
  const bool tiled = spec.tile_width > 0, wide = type == TypeDesc::DOUBLE;
  if (wide && tiled)
    refuse_image(request, "has 64-bit float samples in tiles, which this program cannot read",
                 "save it as 32-bit float");
  const int tile_width = tiled ? spec.tile_width : spec.width, tile_height = tiled ? spec.tile_height : 1;
  const auto up = [](int end, int step, int most) { return std::min((end + step - 1) / step * step, most); };
  const PixelRect held = wide ? PixelRect{0, 0, spec.width, spec.height}
                              : PixelRect{part.x0 / tile_width * tile_width, part.y0 / tile_height * tile_height,
                                          up(part.x1, tile_width, spec.width), up(part.y1, tile_height, spec.height)};
  const std::size_t row_bytes = std::size_t(held.width()) * (last - first) * type.size();
  const int band = wide ? held.height()
                        : up(static_cast<int>(std::clamp<std::size_t>(kBandBytes / row_bytes, 1, held.height())),
                             tile_height, held.height());
  Block block;
  block.channels = last - first;
  block.bytes.resize(row_bytes * band);

  Image values;
  for (int row = held.y0; row < held.y1; row += band) {
    block.at = {held.x0, row, held.x1, std::min(row + band, held.y1)};
    const int x = spec.x, y = spec.y;
    const bool read = tiled
                          ? input.read_tiles(page, 0, x + block.at.x0, x + block.at.x1, y + block.at.y0,
                                             y + block.at.y1, spec.z, spec.z + 1, first, last, type, block.bytes.data())
                          : input.read_scanlines(page, 0, y + block.at.y0, y + block.at.y1, spec.z, first, last, type,
                                                 block.bytes.data());
    // Some decoders (JPEG) fill what is missing with grey, report success and leave a message.
    if (!read || input.has_error()) refuse_damaged(request, signature, decoder_message(input));
    if (values.empty()) values = Image(part.width(), part.height());
    switch (type.basetype) {
      case TypeDesc::UINT8:
        add_samples<std::uint8_t>(block, offsets, packed, part, values);
        break;
      case TypeDesc::INT8:
        add_samples<std::int8_t>(block, offsets, packed, part, values);
        break;
      case TypeDesc::UINT16:
        add_samples<std::uint16_t>(block, offsets, packed, part, values);
        break;
      case TypeDesc::INT16:
        add_samples<std::int16_t>(block, offsets, packed, part, values);
        break;
      case TypeDesc::UINT32:
        add_samples<std::uint32_t>(block, offsets, packed, part, values);
        break;
      case TypeDesc::INT32:
        add_samples<std::int32_t>(block, offsets, packed, part, values);
        break;
      case TypeDesc::FLOAT:
        add_samples<float>(block, offsets, packed, part, values);
        break;
      case TypeDesc::DOUBLE:
        add_samples<double>(block, offsets, packed, part, values);
        break;
      default:
        refuse_image(request, fmt::format("has samples of type {}", type.c_str()),
                     "save it as 8- or 16-bit integers or float");
    }
  }
  return values;
}

/// White-is-zero turned round: larger is brighter. Unsigned counts by their top code, signed ones by their bits; floats
/// have no top but the 1 that programs give them. OpenImageIO does so itself for 8 bits and less. What a stored 0
/// became.
double invert_white_is_zero(const OIIO::ImageSpec& spec, double top_code, Image& values) {
  const double top = top_code > 0                      ? top_code
                     : spec.format.is_floating_point() ? 1
                     : spec.format == TypeDesc::UINT32 ? 4294967295.0
                                                       : -1;
  if (spec.format != TypeDesc::UINT8)
    for (double& value : values.values()) value = top - value;
  return top;
}

/// Where BitsPerSample is left to its default of 1, OpenImageIO takes 8: the file with the tag; else nothing.
std::string with_one_bit_stated(const ImageRequest& request) {
  const std::size_t page = static_cast<std::size_t>(std::max(request.page.value_or(0), 0));
  const TiffTags tags = read_tiff_tags(request.path, page + 1);
  if (tags.pages.size() <= page || tags.pages[page].states_bits) return {};
  if (!request.mask) refuse_one_bit(request);
  std::string content = with_stated_bit(request.path, tags, page);
  if (content.empty() || tags.pages[page].samples != 1)
    refuse_image(request, "has 1 bit per sample and does not say so", "save it with 8 bits");
  return content;
}

/// How samples are stored.
struct Stored {
  int bits = 0;  ///< of a sample
  bool is_float = false, tiff = false, palette = false;
  int photometric = -1;  ///< of TIFF
};
constexpr int kWhiteIsZero = 0, kPalette = 3, kSubsampledColour = 6;

Stored how_stored(const Signature& signature, const OIIO::ImageSpec& spec) {
  Stored stored;
  stored.is_float = spec.format.is_floating_point();
  stored.bits = signature.stored_bits > 0 && signature.format != "bmp"
                    ? signature.stored_bits
                    : spec.get_int_attribute("oiio:BitsPerSample", static_cast<int>(spec.format.size()) * 8);
  stored.tiff = signature.format == "tiff";
  if (stored.tiff) stored.photometric = spec.get_int_attribute("tiff:PhotometricInterpretation", 1);
  stored.palette = signature.palette || stored.photometric == kPalette;
  return stored;
}

bool is_small_integer(const OIIO::ImageSpec& spec) {
  return spec.format == TypeDesc::UINT8 || spec.format == TypeDesc::UINT16;
}

/// Packed samples of 2 to 14 bits are handed out expanded to the full range of 8 or 16: what makes them counts again; 1
/// for all others.
double packed_scale(const Signature& signature, const OIIO::ImageSpec& spec, const Stored& stored) {
  const int bits = static_cast<int>(spec.format.size()) * 8;
  const bool packed =
      is_small_integer(spec) && stored.bits < bits && !stored.palette && (stored.tiff || signature.format == "png");
  return packed ? (std::exp2(stored.bits) - 1) / (std::exp2(bits) - 1) : 1;
}

/// From the header, before anything of the image's size is allocated.
void check_header(const ImageRequest& request, const Signature& signature, const OIIO::ImageSpec& spec,
                  const Stored& stored) {
  if (spec.width < 1 || spec.height < 1) refuse_damaged(request, signature, " (it has no pixels)");
  check_image_size(request, spec.width, spec.height);
  if (spec.depth > 1 || spec.deep)
    refuse_image(request, spec.deep ? "is a deep image" : "is a volume, not an image", "export one plane of it");
  if (stored.bits == 1 && !request.mask) refuse_one_bit(request);
  if (stored.photometric == kCfaPhotometric && !request.cells)
    refuse_image(request, "is a colour filter mosaic: its pixels see red, green and blue in cells of 2 x 2",
                 "add `bayer: rggb` (or bggr, grbg, gbrg) and `channel: g`");
  if (stored.tiff && stored.photometric > kPalette && stored.photometric != kSubsampledColour &&
      stored.photometric != kCfaPhotometric && stored.photometric != kLinearRawPhotometric)
    refuse_image(request, "is stored in a print or perceptual colour space (CMYK, Lab, ...)", "save it as grey or RGB");
  if (const std::string space = spec.get_string_attribute("jpeg:ColorSpace", ""); space == "CMYK" || space == "YCbCrK")
    refuse_image(request, "is stored in the print colour space " + space, "save it as grey or RGB");
  if (stored.bits == 24 && stored.tiff)
    refuse_image(request, "has 24 bits per sample", "save it as 16-bit integers or float");
  if (!spec.channelformats.empty())
    for (const TypeDesc& type : spec.channelformats)
      if (!type.is_floating_point())
        refuse_image(request, "has channels of different types", "save it as a grey image of 16-bit integers or float");
}

/// The page that is asked for, or the only one.
int page_asked(const ImageRequest& request, OIIO::ImageInput& input, bool several) {
  int page = 0;
  if (several && !request.page) {
    const int pages = count_pages(input);
    refuse_image(request,
                 fmt::format("has {}{} pages and none is chosen ({})", pages == kCountedPages ? "at least " : "", pages,
                             list_pages(input, pages, request.path)),
                 request.mask ? "save the one that is the mask as a file of its own"
                              : "add `page: 0` for the first; micrographs: {files: ..} takes each as an image");
  }
  if (request.page) {
    page = *request.page;
    if (page < 0 || !input.seek_subimage(page, 0)) {
      (void)input.geterror();
      const int pages = count_pages(input);
      refuse_image(
          request,
          fmt::format("has no page {}: it has {} ({})", page, pages == 1 ? "1 page" : fmt::format("{} pages", pages),
                      list_pages(input, pages, request.path)),
          "pages count from 0");
    }
  }
  return page;
}

/// Counts as the camera had them, and what is to be said of their codes.
void settle_codes(const ImageRequest& request, const Signature& signature, const OIIO::ImageSpec& spec,
                  const Stored& stored, bool packed, LoadedImage& loaded) {
  if (is_small_integer(spec)) {
    loaded.bits = static_cast<int>(spec.format.size()) * 8;
    loaded.top_code = loaded.bits == 8 ? 255 : 65535;
    if (packed) {
      loaded.top_code = std::exp2(stored.bits) - 1;
      if (!request.mask)
        loaded.notes.push_back(fmt::format("{}-bit samples: counts from 0 to {:.0f}", stored.bits, loaded.top_code));
    }
  } else {
    loaded.bits = 32;
    if (!stored.is_float)
      loaded.notes.push_back(fmt::format("{}: read as float, the saturation code is not known", describe_type(spec)));
    else if (spec.format == TypeDesc::HALF)
      loaded.notes.push_back("16-bit float samples hold three decimal digits only");
  }
  if (stored.palette && !request.mask)
    loaded.notes.push_back(
        "palette image: its colours, not its indices, are the intensities; fit the original if you can");
  if (signature.lossy || stored.photometric == kSubsampledColour)
    loaded.notes.push_back("lossy compression has changed the counts and their noise; fit the original if you can");
  if (stored.photometric == kWhiteIsZero) {
    loaded.stored_zero = invert_white_is_zero(spec, loaded.top_code, loaded.values);
    if (!request.mask)
      loaded.notes.push_back("white is stored as zero: values inverted on reading, larger is brighter");
  }
}

/// `content`: of the file, where it is to be read otherwise than it stands there; else empty.
LoadedImage load_checked(const ImageRequest& request, const Signature& signature, std::string content = {}) {
  if (signature.animated)
    refuse_image(request, "is animated (" + signature.format_name + ")",
                 "extract the frame to be fitted as a still image");
  if (signature.stored_bits == 1 && !request.mask) refuse_one_bit(request);
  if (signature.truncated) refuse_damaged(request, signature, " (its end is missing)");

  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(signature.format);
  if (!input) {
    (void)OIIO::geterror();
    refuse_image(request, "cannot be read: this OpenImageIO has no " + signature.format_name + " support",
                 "convert it to TIFF");
  }
  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory;
  if (content.empty() && signature.format == "tiff") content = with_one_bit_stated(request);
  if (!content.empty()) {
    memory = std::make_unique<OIIO::Filesystem::IOMemReader>(content.data(), content.size());
    if (!input->set_ioproxy(memory.get())) throw std::runtime_error("OpenImageIO cannot read TIFF from memory");
  }
  OIIO::ImageSpec settings, spec;
  settings.attribute("oiio:UnassociatedAlpha", 1);
  settings.attribute("bmp:monochrome_detect", 1);
  if (!input->open(request.path.string(), spec, settings)) refuse_damaged(request, signature, decoder_message(*input));

  // Of a stack the first page alone may say what all of them are (OME, ImageJ, tifffile).
  const OIIO::ImageSpec first = spec;
  const bool several = input->seek_subimage(1, 0);
  (void)input->geterror();
  if (several && (signature.format == "gif" || spec.get_int_attribute("oiio:Movie", 0) != 0))
    refuse_image(request, "is animated (" + signature.format_name + ")",
                 "extract the frame to be fitted as a still image");
  // What has looked for a second picture in a still WebP can decode the first no more.
  if (signature.format == "webp" && !several &&
      (!input->close() || !input->open(request.path.string(), spec, settings)))
    refuse_damaged(request, signature, decoder_message(*input));
  if (signature.format == "tiff" && memory == nullptr && !several && !request.page &&
      read_tiff_tags(request.path, 2).cut_off)
    refuse_image(request, "is cut off: further pages are announced behind the end of the file",
                 "copy it again from its source, or add `page: 0` for the one that is left");
  const int page = page_asked(request, *input, several);
  if (!input->seek_subimage(page, 0)) refuse_damaged(request, signature, decoder_message(*input));
  spec = input->spec(page, 0);
  const Stored stored = how_stored(signature, spec);
  check_header(request, signature, spec, stored);

  LoadedImage loaded;
  const auto who_states = [&](const char* what) -> const OIIO::ImageSpec& {
    return !spec.find_attribute(what) && spec.width == first.width && spec.height == first.height ? first : spec;
  };
  const std::string description = who_states("ImageDescription").get_string_attribute("ImageDescription", "");
  const std::vector<int> channels = chosen_channels(request, spec, stored.palette, loaded.notes);
  loaded.colour = spec.nchannels >= 3;
  const PixelRect part = part_asked(request, spec.width, spec.height);
  loaded.width = spec.width, loaded.height = spec.height;
  loaded.x0 = part.x0, loaded.y0 = part.y0;
  const double packed = packed_scale(signature, spec, stored);
  loaded.values = read_samples(request, signature, *input, page, spec, channels, packed, part);
  settle_codes(request, signature, spec, stored, packed != 1, loaded);
  if (const int orientation = spec.get_int_attribute("Orientation", 1); orientation > 1 && orientation <= 8)
    loaded.notes.push_back(fmt::format("orientation tag {} ignored: rows and columns are as stored", orientation));
  if (spec.x != spec.full_x || spec.y != spec.full_y || spec.width != spec.full_width ||
      spec.height != spec.full_height)
    loaded.notes.push_back("the stored pixels are a window of a larger canvas: (0, 0) is the first stored pixel");
  if (const double stack = number_or_zero(imagej_value(description, "images")); stack > 1 && !several) {
    const std::string found = fmt::format("is an ImageJ stack of {:.0f} images with a single TIFF page", stack);
    if (!request.page)
      refuse_image(request, found, "save the image to be fitted on its own, or add `page: 0` for the first");
    loaded.notes.push_back("it " + found + ": the first is used");
  }
  if (signature.format == "tiff" && !several)
    if (const TiffTags tags = read_tiff_tags(request.path, 1);
        tags.pages.size() == 1 && tags.pages[0].stack_planes > 1) {
      const std::string found =
          fmt::format("is a stack of MetaMorph (STK): {} planes under one directory", tags.pages[0].stack_planes);
      if (!request.page)
        refuse_image(request, found, "save its planes as pages of a TIFF, or add `page: 0` for the first");
      loaded.notes.push_back("it " + found + ": the first is used");
    }
  // Of tifffile, where only the first of many planes has a directory.
  if (!several && !request.page && description.starts_with("{\"shape\"") &&
      description.find("\"truncated\": true") != std::string::npos)
    refuse_image(request,
                 "is a stack of tifffile, truncated: one directory for all of its planes (" + description + ")",
                 "save the image to be fitted on its own, or add `page: 0` for the first");
  const OIIO::ImageSpec& scaled = who_states("XResolution");
  const StatedResolution resolution{scaled.get_float_attribute("XResolution", 0),
                                    scaled.get_float_attribute("YResolution", 0),
                                    scaled.get_string_attribute("ResolutionUnit", "")};
  loaded.pixel_size_um = stated_pixel_size_um(resolution, description, loaded.notes, loaded.uneven_pixel_um);
  const StatedOptics optics = stated_optics(description);
  loaded.objective_na = optics.objective_na, loaded.emission_nm = optics.emission_nm;
  return loaded;
}

/// The picture of a raw photograph, never its thumbnail.
LoadedImage load_raw(const ImageRequest& request, const TiffTags& tags) {
  std::vector<TiffDirectory> whole_pictures;
  for (const auto& directories : {tags.pages, tags.children})
    for (const TiffDirectory& directory : directories)
      if (!directory.reduced()) whole_pictures.push_back(directory);
  const auto picture = std::max_element(
      whole_pictures.begin(), whole_pictures.end(),
      [](const TiffDirectory& a, const TiffDirectory& b) { return a.width * a.height < b.width * b.height; });
  const std::string develop = "save it as a linear 16-bit TIFF (dcraw -D -4 -T keeps the mosaic, for `bayer: rggb`)";
  if (picture != whole_pictures.end() && picture->photometric != kCfaPhotometric && !tags.canon_raw) {
    // Not under filters: a sub-image of colours or grey.
    try {
      ImageRequest asked = request;
      asked.page.reset();
      LoadedImage loaded = load_checked(asked, {"tiff", "TIFF"}, beginning_with(request.path, tags, *picture));
      loaded.notes.insert(loaded.notes.begin(),
                          fmt::format("raw photograph: its picture of {} x {} pixels is read, not its thumbnail",
                                      loaded.width, loaded.height));
      return loaded;
    } catch (const UserError& error) {
      // What is wrong with the request is to be said as it is.
      if (std::string(error.what()).find("damaged") == std::string::npos) throw;
    }
  } else if (std::optional<RawPhotograph> raw = read_raw_photograph(request.path)) {
    if (picture != whole_pictures.end() && picture->pattern.size() == 4) raw->pattern = picture->pattern;
    const std::string filters = raw->pattern.empty() ? "in an order that it does not state" : "(" + raw->pattern + ")";
    if (!request.cells)
      refuse_image(request,
                   fmt::format("is a raw photograph: {} x {} pixels under a mosaic of colour filters {}",
                               raw->counts.width(), raw->counts.height(), filters),
                   "add `bayer: " + (raw->pattern.empty() ? "rggb" : raw->pattern) + "` and `channel: g` (or r, b)");
    LoadedImage loaded;
    loaded.width = raw->counts.width(), loaded.height = raw->counts.height();
    const PixelRect part = part_asked(request, loaded.width, loaded.height);
    loaded.x0 = part.x0, loaded.y0 = part.y0;
    loaded.values = cropped(raw->counts, part);
    loaded.bits = 16;
    loaded.top_code = 65535;
    loaded.filter_pattern = raw->pattern;
    loaded.notes.push_back("raw photograph: counts of the sensor under filters " + filters +
                           ", before any white balance or curve");
    return loaded;
  }
  const std::string readable = tags.pages.empty()
                                   ? "this program cannot read its picture"
                                   : fmt::format("the readable image in it is a thumbnail of {} x {} pixels",
                                                 tags.pages.front().width, tags.pages.front().height);
  refuse_image(request, "is a raw photograph; " + readable, develop);
}

// ---- writing --------------------------------------------------------------------------------------------------------

/// The whole file in memory: every byte then goes through write_files, which sees a full disk; libtiff would not say.
template <class T>
std::string encode(const std::string& format, const OIIO::ImageSpec& spec, const std::vector<T>& samples) {
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(format);
  if (!output || !output->supports("ioproxy") || !output->set_ioproxy(&memory))
    throw std::runtime_error("OpenImageIO cannot write " + format + " to memory");
  // close() leaves a message about Exif data that there are none of; its return value is what counts.
  if (!output->open("memory." + format, spec) || !output->write_image(spec.format, samples.data()) || !output->close())
    throw std::runtime_error("OpenImageIO cannot write " + format + ": " + output->geterror());
  (void)output->geterror();
  return std::string(bytes.begin(), bytes.end());
}

}  // namespace

std::string encode_channels(std::span<const Image> channels, const fs::path& path, double pixel_size_um) {
  const std::string extension = lower_case(path.extension().string());
  const Image& first = channels.front();
  if (first.empty()) throw std::logic_error("save_image: empty image");
  const auto count = static_cast<int>(channels.size());
  const auto samples_by = [&]<class T>(const auto& sample) {
    std::vector<T> samples;
    samples.reserve(first.size() * channels.size());
    for (std::size_t i = 0; i < first.size(); ++i)
      for (const Image& channel : channels) samples.push_back(sample(channel.values()[i]));
    return samples;
  };
  if (extension == ".png") {
    const auto samples = samples_by.operator()<std::uint16_t>([](double value) {
      return static_cast<std::uint16_t>(std::lround(value > 0 ? std::min(value, 1.0) * 65535 : 0.0));  // NaN is 0
    });
    return encode("png", OIIO::ImageSpec(first.width(), first.height(), count, TypeDesc::UINT16), samples);
  }
  if (extension == ".npy") return encode_npy(channels);
  if (extension != ".tif" && extension != ".tiff" && extension != ".exr")
    throw UserError({path.string()}, "has an unknown image extension '" + extension + "'",
                    "use .tif or .exr (32-bit float), .npy (64-bit) or .png (16-bit, 0 to 1)");
  OIIO::ImageSpec spec(first.width(), first.height(), count, TypeDesc::FLOAT);
  // TIFFs unpacked: no two of ImageJ, tifffile and scikit-image read the same packing of floats.
  spec.attribute("compression", extension == ".exr" ? "zip" : "none");
  if (pixel_size_um > 0) {
    // OpenEXR counts by the inch alone.
    const bool by_inch = extension == ".exr";
    const auto density = static_cast<float>((by_inch ? 2.54e4 : 1e4) / pixel_size_um);
    spec.attribute("ResolutionUnit", by_inch ? "in" : "cm");
    spec.attribute("XResolution", density);
    spec.attribute("YResolution", density);
  }
  const auto samples = samples_by.operator()<float>([](double value) { return static_cast<float>(value); });
  return encode(extension == ".exr" ? "openexr" : "tiff", spec, samples);
}

LoadedImage load_by_libraries(const ImageRequest& request) {
  const Signature signature = read_signature(request.path, fs::file_size(request.path));
  if (signature.format.empty())
    refuse_image(request, "is no image of a kind birefit reads",
                 "use PNG, TIFF, OpenEXR, JPEG, BMP, GIF, WebP or .npy");
  try {
    const TiffTags tags = signature.format == "tiff" ? read_tiff_tags(request.path, 1) : TiffTags{};
    if (signature.format == "raw" || is_raw_photograph(tags)) return load_raw(request, tags);
    return load_checked(request, signature);
  } catch (const std::length_error&) {  // of a library that believes a header
    refuse_damaged(request, signature, " (it states a size that no memory holds)");
  }
}

std::vector<unsigned char> encode_png(const std::vector<unsigned char>& samples, int width, int height, int channels) {
  if (samples.size() != static_cast<std::size_t>(width) * height * channels || (channels != 1 && channels != 3))
    throw std::logic_error("encode_png: the samples do not fill the image");
  const std::string file = encode("png", OIIO::ImageSpec(width, height, channels, TypeDesc::UINT8), samples);
  return {file.begin(), file.end()};
}

}  // namespace birefit
