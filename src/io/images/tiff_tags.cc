#include "io/images/tiff_tags.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <string_view>

namespace birefit {
namespace {

enum Tag {
  kSubfile = 254,
  kWidth = 256,
  kHeight = 257,
  kBits = 258,
  kPhotometric = 262,
  kDescription = 270,
  kSamples = 277,
  kSubIfds = 330,
  kCfaPattern = 33422,
  kUic2 = 33629,
  kDngVersion = 50706
};
constexpr std::uint64_t kMostEntries = 4096, kMostChildren = 16, kMostText = 1 << 26;

/// Integers of either byte order at any place of a file; nothing behind its end.
class TiffFile {
 public:
  explicit TiffFile(const std::filesystem::path& path) : stream_(path, std::ios::binary) {
    const std::string head = bytes(0, 4);
    using namespace std::string_view_literals;
    big_endian = head == "MM\0*"sv || head == "MM\0+"sv;
    big_tiff = head == "II+\0"sv || head == "MM\0+"sv;
    good = big_endian || big_tiff || head == "II*\0"sv;
    canon_raw = good && bytes(8, 2) == "CR";
  }

  std::optional<std::uint64_t> number(std::uint64_t at, int size) {
    const std::string text = bytes(at, static_cast<std::size_t>(size));
    if (text.size() < static_cast<std::size_t>(size)) return std::nullopt;
    std::uint64_t value = 0;
    for (int i = 0; i < size; ++i)
      value = value << 8 | static_cast<unsigned char>(text[static_cast<std::size_t>(big_endian ? i : size - 1 - i)]);
    return value;
  }

  /// Fewer where the file ends before.
  std::string bytes(std::uint64_t at, std::size_t count) {
    if (count > kWindow / 2) return read(at, count);
    const bool held =
        at >= window_at_ && at - window_at_ < window_.size() && window_.size() - (at - window_at_) >= count;
    if (!held) window_ = read(at, kWindow), window_at_ = at;
    return window_.substr(at - window_at_, count);
  }

  bool good = false, big_endian = false, big_tiff = false, canon_raw = false;

 private:
  // A directory is some dozens of numbers, small pages have many directories in a window: of a stack whose pages are
  // read one by one the chain is walked as often, and a seek for each number would take minutes.
  static constexpr std::size_t kWindow = 1 << 16;

  std::string read(std::uint64_t at, std::size_t count) {
    std::string text(count, '\0');
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(at));
    stream_.read(text.data(), static_cast<std::streamsize>(count));
    text.resize(static_cast<std::size_t>(std::max<std::streamsize>(stream_.gcount(), 0)));
    return text;
  }

  std::ifstream stream_;
  std::string window_;  ///< what was read last, from window_at_ on
  std::uint64_t window_at_ = 0;
};

/// The directory at `offset`, and in `next` where the chain goes on; nothing where the file ends before it does.
std::optional<TiffDirectory> read_directory(TiffFile& file, std::uint64_t offset, std::uint64_t link,
                                            std::uint64_t& next_link, bool first) {
  const int word = file.big_tiff ? 8 : 4, count_size = file.big_tiff ? 8 : 2, entry_size = file.big_tiff ? 20 : 12;
  TiffDirectory directory;
  directory.offset = offset, directory.link = link;
  const auto count = file.number(offset, count_size);
  if (!count || *count > kMostEntries) return std::nullopt;
  next_link = offset + static_cast<std::uint64_t>(count_size) + *count * static_cast<std::uint64_t>(entry_size);
  for (std::uint64_t i = 0; i < *count; ++i) {
    const std::uint64_t entry =
        offset + static_cast<std::uint64_t>(count_size) + i * static_cast<std::uint64_t>(entry_size);
    const auto tag = file.number(entry, 2), type = file.number(entry + 2, 2), values = file.number(entry + 4, word);
    if (!tag || !type || !values) return std::nullopt;
    // BYTE, SHORT, LONG, IFD, LONG8, IFD8: the tags looked at here are all of these.
    const int size = *type == 1                   ? 1
                     : *type == 3                 ? 2
                     : *type == 4 || *type == 13  ? 4
                     : *type == 16 || *type == 18 ? 8
                                                  : 0;
    const std::uint64_t field = entry + 4 + static_cast<std::uint64_t>(word);
    const auto value = [&](std::uint64_t k) -> std::uint64_t {
      std::uint64_t from = field;
      if (*values * static_cast<std::uint64_t>(size) > static_cast<std::uint64_t>(word))
        from = file.number(field, word).value_or(0);
      return size ? file.number(from + k * static_cast<std::uint64_t>(size), size).value_or(0) : 0;
    };
    switch (*tag) {
      case kSubfile:
        directory.subfile = static_cast<int>(value(0));
        break;
      case kWidth:
        directory.width = value(0);
        break;
      case kHeight:
        directory.height = value(0);
        break;
      case kBits:
        directory.bits = static_cast<int>(value(0)), directory.states_bits = true;
        break;
      case kPhotometric:
        directory.photometric = static_cast<int>(value(0));
        break;
      case kDescription:
        if (constexpr std::uint64_t kAscii = 2; first && *type == kAscii && *values <= kMostText) {
          const bool inside = *values <= static_cast<std::uint64_t>(word);
          directory.description = file.bytes(inside ? field : file.number(field, word).value_or(0), *values);
          directory.description.resize(std::min(directory.description.find('\0'), directory.description.size()));
        }
        break;
      case kSamples:
        directory.samples = static_cast<int>(value(0));
        break;
      case kSubIfds:
        for (std::uint64_t k = 0; k < std::min(*values, kMostChildren); ++k) directory.children.push_back(value(k));
        break;
      case kCfaPattern:
        if (*values == 4)
          for (std::uint64_t k = 0; k < 4; ++k)
            if (const std::uint64_t colour = value(k); colour < 3) directory.pattern += "rgb"[colour];
        break;
      case kUic2:
        directory.stack_planes = *values;
        break;
      case kDngVersion:
        directory.dng = true;
        break;
      default:
        break;
    }
  }
  return directory;
}

std::string bytes_of(std::uint64_t value, int size, bool big_endian) {
  std::string text;
  for (int i = 0; i < size; ++i) text += static_cast<char>(value >> (8 * (big_endian ? size - 1 - i : i)) & 255);
  return text;
}

/// Empty where offsets are not of 4 bytes, or the file is too large to hold.
std::string whole(const std::filesystem::path& path, const TiffTags& tags) {
  constexpr std::uintmax_t kMostBytes = std::uintmax_t{1} << 31;
  if (tags.big_tiff || std::filesystem::file_size(path) > kMostBytes) return {};
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace

TiffTags read_tiff_tags(const std::filesystem::path& path, std::size_t most_pages) {
  TiffFile file(path);
  TiffTags tags;
  if (!file.good) return tags;
  tags.big_endian = file.big_endian, tags.big_tiff = file.big_tiff, tags.canon_raw = file.canon_raw;
  const int word = file.big_tiff ? 8 : 4;
  std::uint64_t link = file.big_tiff ? 8 : 4;
  std::set<std::uint64_t> visited;  // a damaged chain may turn back
  while (tags.pages.size() < most_pages) {
    const auto offset = file.number(link, word);
    if (offset && (*offset == 0 || !visited.insert(*offset).second)) break;
    std::uint64_t next = 0;
    auto directory =
        offset ? read_directory(file, *offset, link, next, tags.pages.empty()) : std::optional<TiffDirectory>();
    tags.cut_off = !directory;
    if (!directory) break;
    tags.pages.push_back(std::move(*directory));
    link = next;
  }
  if (!tags.pages.empty())
    for (const std::uint64_t offset : tags.pages[0].children) {
      std::uint64_t next = 0;
      if (auto directory = read_directory(file, offset, 0, next, false)) tags.children.push_back(std::move(*directory));
    }
  return tags;
}

std::string with_stated_bit(const std::filesystem::path& path, const TiffTags& tags, std::size_t page) {
  if (page >= tags.pages.size()) return {};
  std::string content = whole(path, tags);
  const auto number = [&](std::uint64_t value, int size) { return bytes_of(value, size, tags.big_endian); };
  const auto tag_at = [&](std::size_t at) {
    const unsigned first = static_cast<unsigned char>(content[at]),
                   second = static_cast<unsigned char>(content[at + 1]);
    return tags.big_endian ? first << 8 | second : second << 8 | first;
  };
  const TiffDirectory& directory = tags.pages[page];
  const std::size_t start = directory.offset;
  if (start + 2 > content.size()) return {};
  const std::size_t count = tag_at(start), end = start + 2 + 12 * count;
  if (end + 4 > content.size()) return {};
  // Entries are sorted by their tags.
  std::size_t at = start + 2;
  while (at < end && tag_at(at) < kBits) at += 12;
  const std::string entry = number(kBits, 2) + number(3, 2) + number(1, 4) + number(1, 2) + number(0, 2);
  std::string copy =
      number(count + 1, 2) + content.substr(start + 2, at - start - 2) + entry + content.substr(at, end + 4 - at);
  if (content.size() % 2) content += '\0';  // directories start at even places
  content.replace(directory.link, 4, number(content.size(), 4));
  return content + copy;
}

std::string beginning_with(const std::filesystem::path& path, const TiffTags& tags, const TiffDirectory& directory) {
  std::string content = whole(path, tags);
  if (content.size() >= 8) content.replace(4, 4, bytes_of(directory.offset, 4, tags.big_endian));
  return content;
}

}  // namespace birefit
