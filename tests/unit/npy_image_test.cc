// Pictures that are NumPy's arrays, written here by the description of the format.
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include "birefit/io.h"
#include "io/images/mask.h"
#include "io/images/pages.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class NpyImage : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("birefit_npy_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// An array of this description, whose numbers are these bytes.
  fs::path file(const std::string& descr, const std::string& shape, const std::string& data, bool fortran = false,
                int version = 1) {
    std::string header =
        "{'descr': '" + descr + "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape + ", }";
    const std::size_t before = version == 1 ? 10 : 12;
    while ((before + header.size() + 1) % 64 != 0) header += ' ';
    header += '\n';
    std::string content = "\x93NUMPY";
    content += {static_cast<char>(version), '\0'};
    for (std::size_t i = 0; i < before - 8; ++i) content += static_cast<char>(header.size() >> 8 * i & 255);
    const fs::path path = folder_ / ("a" + std::to_string(++files_) + ".npy");
    std::ofstream(path, std::ios::binary) << content << header << data;
    return path;
  }

  static LoadedImage load(const fs::path& path, std::optional<int> page = {}, const std::string& channel = "",
                          std::optional<PixelRect> region = {}) {
    ImageRequest request{path, page, channel, {"job.yaml", 3, 5}};
    request.region = region;
    return load_image(request);
  }
  static std::string refused(const fs::path& path, std::optional<int> page = {}, const std::string& channel = "") {
    try {
      load(path, page, channel);
    } catch (const UserError& error) {
      return error.what();
    }
    return "accepted";
  }

 private:
  fs::path folder_;
  int files_ = 0;
};

/// The bytes of numbers, the last first where `big`.
template <class T>
std::string bytes_of(const std::vector<T>& numbers, bool big = false) {
  std::string bytes;
  for (T number : numbers) {
    std::string one(reinterpret_cast<const char*>(&number), sizeof number);
    if (big != (std::endian::native == std::endian::big)) std::reverse(one.begin(), one.end());
    bytes += one;
  }
  return bytes;
}

TEST_F(NpyImage, CountsAreCounts) {
  const LoadedImage bytes = load(file("|u1", "(2, 3)", bytes_of<std::uint8_t>({0, 1, 2, 253, 254, 255})));
  EXPECT_EQ(bytes.values.width(), 3);
  EXPECT_EQ(bytes.values.height(), 2);
  EXPECT_EQ(bytes.values(2, 0), 2);
  EXPECT_EQ(bytes.values(0, 1), 253);
  EXPECT_EQ(bytes.top_code, 255);
  EXPECT_EQ(bytes.bits, 8);
  EXPECT_THAT(bytes.notes, IsEmpty());
  for (const bool big : {false, true}) {
    const LoadedImage words =
        load(file(big ? ">u2" : "<u2", "(1, 2)", bytes_of<std::uint16_t>({258, 65535}, big), false, big ? 2 : 1));
    EXPECT_EQ(words.values(0, 0), 258);
    EXPECT_EQ(words.values(1, 0), 65535);
    EXPECT_EQ(words.top_code, 65535);
  }
  const LoadedImage wide = load(file("<i4", "(1, 2)", bytes_of<std::int32_t>({-3, 70000})));
  EXPECT_EQ(wide.values(0, 0), -3);
  EXPECT_EQ(wide.top_code, 0);
  EXPECT_THAT(wide.notes, Contains(HasSubstr("32-bit signed integer: read as float")));
}

TEST_F(NpyImage, FloatsKeepAllTheirDigits) {
  const std::vector<double> numbers = {0.1, 1 + 1e-15, std::numeric_limits<double>::quiet_NaN(), 1e-300};
  const LoadedImage image = load(file("<f8", "(2, 2)", bytes_of(numbers)));
  EXPECT_EQ(image.values(0, 0), 0.1);
  EXPECT_EQ(image.values(1, 0), 1 + 1e-15);
  EXPECT_TRUE(std::isnan(image.values(0, 1)));
  EXPECT_EQ(image.values(1, 1), 1e-300);
  EXPECT_EQ(image.bits, 32);
  EXPECT_EQ(load(file("<f4", "(1, 1)", bytes_of<float>({0.1f}))).values(0, 0), 0.1f);
  // IEEE 754, binary16: 1, -2, the largest, the smallest, the next to 1/3, nothing.
  const LoadedImage half =
      load(file(">f2", "(2, 3)", bytes_of<std::uint16_t>({0x3c00, 0xc000, 0x7bff, 0x0001, 0x3555, 0x7e00}, true)));
  EXPECT_EQ(half.values(0, 0), 1);
  EXPECT_EQ(half.values(1, 0), -2);
  EXPECT_EQ(half.values(2, 0), 65504);
  EXPECT_EQ(half.values(0, 1), std::exp2(-24));
  EXPECT_EQ(half.values(1, 1), 1365.0 / 4096);
  EXPECT_TRUE(std::isnan(half.values(2, 1)));
  EXPECT_THAT(half.notes, Contains(HasSubstr("three decimal digits")));
}

// a[y, x] = 10 y + x and its transpose in memory are one picture.
TEST_F(NpyImage, TheOrderInMemoryIsOfNoConsequence) {
  std::vector<double> by_rows, by_columns;
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 5; ++x) by_rows.push_back(10 * y + x);
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 4; ++y) by_columns.push_back(10 * y + x);
  for (const auto& path : {file("<f8", "(4, 5)", bytes_of(by_rows)), file("<f8", "(4, 5)", bytes_of(by_columns), true)})
    for (const auto& region : {std::optional<PixelRect>(), std::optional(PixelRect{1, 2, 4, 9})}) {
      const LoadedImage image = load(path, {}, "", region);
      EXPECT_EQ(image.width, 5);
      EXPECT_EQ(image.height, 4);
      EXPECT_EQ(image.values.width(), region ? 3 : 5);
      EXPECT_EQ(image.values.height(), region ? 2 : 4);
      for (int y = 0; y < image.values.height(); ++y)
        for (int x = 0; x < image.values.width(); ++x)
          EXPECT_EQ(image.values(x, y), 10 * (y + image.y0) + x + image.x0);
    }
}

// (rows, columns, channels) and (pictures, rows, columns): a last index of up to four is of channels.
TEST_F(NpyImage, ColoursAndStacksAreToldApart) {
  std::vector<std::uint8_t> numbers(2 * 3 * 3);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<std::uint8_t>(i);
  const fs::path colours = file("|u1", "(2, 3, 3)", bytes_of(numbers));
  EXPECT_THAT(refused(colours), HasSubstr("none is chosen"));
  EXPECT_EQ(load(colours, {}, "g").values(1, 1), 3 * (3 * 1 + 1) + 1);
  EXPECT_EQ(load(colours, {}, "mean").values(1, 1), 3 * (3 * 1 + 1) + 1);
  EXPECT_EQ(load(colours, {}, "2").values(0, 0), 2);
  EXPECT_TRUE(load(colours, {}, "b").colour);
  const fs::path covered = file("|u1", "(1, 2, 4)", bytes_of<std::uint8_t>({1, 2, 3, 0, 5, 6, 7, 0}));
  EXPECT_EQ(load(covered, {}, "b").values(1, 0), 7);
  EXPECT_THAT(load(covered, {}, "b").notes, Contains(HasSubstr("alpha")));

  numbers.resize(3 * 2 * 5);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<std::uint8_t>(i);
  const fs::path stack = file("|u1", "(3, 2, 5)", bytes_of(numbers));
  EXPECT_THAT(refused(stack), HasSubstr("has 3 pictures"));
  EXPECT_EQ(load(stack, 2).values(4, 1), 29);
  EXPECT_THAT(refused(stack, 3), HasSubstr("no page 3"));
  EXPECT_EQ(stack_pages(stack).size(), 3u);
  EXPECT_EQ(stack_pages(stack)[2].number, 2);
  EXPECT_EQ(stack_pages(colours).size(), 1u);
  EXPECT_EQ(load(file("|u1", "(1, 2, 5)", bytes_of<std::uint8_t>({0, 1, 2, 3, 4, 5, 6, 7, 8, 9}))).values(4, 1), 9);
}

TEST_F(NpyImage, TruthValuesAreMasks) {
  const fs::path path = file("|b1", "(1, 3)", std::string("\0\1\1", 3));
  EXPECT_THAT(refused(path), HasSubstr("truth values"));
  const LoadedMask mask = load_mask({path, {}, "mean", {"c.yaml", 3, 1}});
  EXPECT_EQ(mask.selected(0, 0), 0);
  EXPECT_EQ(mask.selected(1, 0), 1);
  EXPECT_EQ(mask.selected(2, 0), 1);
}

TEST_F(NpyImage, WhatIsNoPictureIsRefusedAtItsPlace) {
  const std::string four = bytes_of<std::uint8_t>({1, 2, 3, 4});
  EXPECT_THAT(refused(file("|u1", "(2, 3)", four)), HasSubstr("has 4 bytes of data, its shape needs 6"));
  EXPECT_THAT(refused(file("|u1", "(4,)", four)), HasSubstr("of the shape (4,)"));
  EXPECT_THAT(refused(file("|u1", "()", four)), HasSubstr("of the shape ()"));
  EXPECT_THAT(refused(file("|u1", "(2, 0)", "")), HasSubstr("without pixels"));
  EXPECT_THAT(refused(file("|u1", "(20000, 20000)", four)), HasSubstr("20000 x 20000"));
  EXPECT_THAT(refused(file("|u1", "(99999999999999999999999, 2)", four)), HasSubstr("at most"));
  EXPECT_THAT(refused(file("<c16", "(1, 1)", std::string(16, 'x'))), HasSubstr("<c16"));
  EXPECT_THAT(refused(file("|O", "(1, 1)", four)), HasSubstr("neither floats of up to 8 bytes nor integers"));
  const fs::path cut = file("|u1", "(2, 2)", four);
  fs::resize_file(cut, 60);
  EXPECT_THAT(refused(cut), HasSubstr("is cut short"));
  fs::resize_file(cut, 8);
  EXPECT_THAT(refused(cut), HasSubstr("is no NumPy array"));
  try {
    load(cut);
  } catch (const UserError& error) {
    ASSERT_EQ(error.problems().size(), 1u);
    EXPECT_EQ(error.problems()[0].where.line, 3);
  }
}

}  // namespace
}  // namespace birefit
