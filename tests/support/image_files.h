#pragma once
// Image files of a test's own: written with OpenImageIO, or by hand where OpenImageIO would not write such a file.

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <unistd.h>

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "birefit/io.h"

namespace birefit::image_files {

namespace fs = std::filesystem;
using OIIO::ImageSpec;
using OIIO::TypeDesc;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ImageFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("birefit_" + std::to_string(getpid()) + "_" +
                                                ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path path(const std::string& name) const { return folder_ / name; }

  fs::path write_bytes(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }

  template <class T>
  fs::path write(const std::string& name, ImageSpec spec, const std::vector<T>& samples) const {
    auto output = OIIO::ImageOutput::create(name);
    EXPECT_TRUE(output) << name;
    EXPECT_TRUE(output->open(path(name).string(), spec)) << output->geterror();
    EXPECT_TRUE(output->write_image(spec.format, samples.data())) << output->geterror();
    EXPECT_TRUE(output->close());
    return path(name);
  }

  fs::path write_pages(const std::string& name, const std::vector<ImageSpec>& specs) const {
    auto output = OIIO::ImageOutput::create(name);
    EXPECT_TRUE(output->open(path(name).string(), static_cast<int>(specs.size()), specs.data()));
    for (std::size_t i = 0; i < specs.size(); ++i) {
      if (i > 0) {
        EXPECT_TRUE(output->open(path(name).string(), specs[i], OIIO::ImageOutput::AppendSubimage));
      }
      const std::vector<float> samples(specs[i].image_pixels() * specs[i].nchannels, 0.1f * (i + 1));
      EXPECT_TRUE(output->write_image(TypeDesc::FLOAT, samples.data()));
    }
    EXPECT_TRUE(output->close());
    return path(name);
  }

  fs::path truncated(const fs::path& whole, double fraction) const {
    const std::string bytes = content(whole);
    return write_bytes("truncated" + whole.extension().string(),
                       bytes.substr(0, static_cast<std::size_t>(bytes.size() * fraction)));
  }

  static std::string content(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  fs::path folder_;
};

inline LoadedImage load(const fs::path& path, const std::string& channel = {}, std::optional<int> page = {}) {
  return load_image({path, page, channel, {"job.yaml", 3, 5}});
}

/// The message of the UserError that `action` throws; "" when it throws none.
inline std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const UserError& error) {
    EXPECT_EQ(error.problems().size(), 1u);
    EXPECT_FALSE(error.problems()[0].hint.empty()) << error.what();
    return error.what();
  }
  return {};
}

inline std::string refusal(const fs::path& path, const std::string& channel = {}, std::optional<int> page = {}) {
  const std::string message = message_of([&] { (void)load(path, channel, page); });
  EXPECT_THAT(message, AllOf(HasSubstr("job.yaml:3:5: "), HasSubstr(path.filename().string())));
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  return message;
}

inline std::vector<std::uint16_t> noise(std::size_t count) {
  std::vector<std::uint16_t> samples(count);
  std::uint32_t state = 12345;
  for (auto& sample : samples) {
    state = state * 1664525u + 1013904223u;
    sample = static_cast<std::uint16_t>(state >> 16);
  }
  return samples;
}

/// A little-endian TIFF of one strip with the given tags (tag, type 3 or 4, values).
struct Tag {
  std::uint16_t id, type;
  std::vector<std::uint32_t> values;
};
inline std::string tiff_bytes(std::vector<Tag> tags, const std::string& data) {
  std::string bytes = std::string("II*\0", 4), tail;
  const auto put16 = [](std::string& to, std::uint32_t v) { to += char(v & 255), to += char(v >> 8 & 255); };
  const auto put32 = [&](std::string& to, std::uint32_t v) { put16(to, v & 65535), put16(to, v >> 16); };
  tags.push_back({279, 4, {static_cast<std::uint32_t>(data.size())}});
  tags.push_back({273, 4, {8}});
  std::sort(tags.begin(), tags.end(), [](const Tag& a, const Tag& b) { return a.id < b.id; });
  const std::uint32_t directory = 8 + static_cast<std::uint32_t>(data.size() + data.size() % 2);
  put32(bytes, directory);
  bytes += data;
  bytes.resize(directory);
  const std::uint32_t tail_at = directory + 2 + 12 * static_cast<std::uint32_t>(tags.size()) + 4;
  put16(bytes, static_cast<std::uint32_t>(tags.size()));
  for (const Tag& tag : tags) {
    put16(bytes, tag.id), put16(bytes, tag.type), put32(bytes, static_cast<std::uint32_t>(tag.values.size()));
    std::string values;
    for (const std::uint32_t v : tag.values) tag.type == 3 ? put16(values, v) : put32(values, v);
    if (values.size() <= 4) {
      values.resize(4);
      bytes += values;
    } else {
      put32(bytes, tail_at + static_cast<std::uint32_t>(tail.size()));
      tail += values;
    }
  }
  put32(bytes, 0);
  return bytes + tail;
}
inline std::vector<Tag> tiff_tags(std::uint32_t width, std::uint32_t height, std::uint32_t bits,
                                  std::uint32_t photometric) {
  return {{256, 4, {width}},       {257, 4, {height}}, {258, 3, {bits}},  {259, 3, {1}},
          {262, 3, {photometric}}, {277, 3, {1}},      {278, 4, {height}}};
}

inline std::uint32_t crc32(const std::string& bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const unsigned char c : bytes) {
    crc ^= c;
    for (int i = 0; i < 8; ++i) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
  }
  return ~crc;
}
inline std::string png_chunk(const std::string& type, const std::string& data) {
  const auto put32 = [](std::uint32_t v) {
    return std::string{char(v >> 24 & 255), char(v >> 16 & 255), char(v >> 8 & 255), char(v & 255)};
  };
  return put32(static_cast<std::uint32_t>(data.size())) + type + data + put32(crc32(type + data));
}
/// A PNG whose rows (filter bytes included) are stored uncompressed.
inline std::string png_bytes(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                             const std::string& rows, const std::string& palette = {},
                             const std::string& before_data = {}) {
  const auto put32 = [](std::uint32_t v) {
    return std::string{char(v >> 24 & 255), char(v >> 16 & 255), char(v >> 8 & 255), char(v & 255)};
  };
  std::uint32_t a = 1, b = 0;
  for (const unsigned char c : rows) a = (a + c) % 65521, b = (b + a) % 65521;
  const std::size_t n = rows.size();
  std::string zlib = "\x78\x01\x01";
  zlib +=
      std::string{char(n & 255), char(n >> 8 & 255), char(~n & 255), char(~n >> 8 & 255)} + rows + put32(b << 16 | a);
  std::string header = put32(width) + put32(height) + char(bits) + char(colour_type) + std::string(3, '\0');
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) + (palette.empty() ? "" : png_chunk("PLTE", palette)) +
         before_data + png_chunk("IDAT", zlib) + png_chunk("IEND", "");
}

}  // namespace birefit::image_files
