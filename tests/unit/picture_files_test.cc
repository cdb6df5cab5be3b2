// Pictures as other programs write them (tests/data/files, made by its make_pictures.py).

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "birefit/io.h"
#include "io/images/mask.h"

namespace birefit {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

std::filesystem::path file(const std::string& name) {
  return std::filesystem::path(BIREFIT_SOURCE_DIR) / "tests/data/files" / name;
}

LoadedMask mask(const std::string& name) { return load_mask({file(name), {}, "mean", {"c.yaml", 3, 1}}); }
LoadedImage image(const std::string& name) { return load_image({file(name), {}, "", {"c.yaml", 3, 1}}); }

bool in_disc(int x, int y) { return (x - 8) * (x - 8) + (y - 6) * (y - 6) <= 31; }

class MaskFile : public ::testing::TestWithParam<const char*> {};

TEST_P(MaskFile, SelectsTheDiscAndSaysSo) {
  const LoadedMask loaded = mask(GetParam());
  ASSERT_EQ(loaded.selected.width(), 17);
  ASSERT_EQ(loaded.selected.height(), 13);
  for (int y = 0; y < 13; ++y)
    for (int x = 0; x < 17; ++x) ASSERT_EQ(loaded.selected(x, y) != 0, in_disc(x, y)) << x << ' ' << y;
  EXPECT_THAT(loaded.notes, Contains(HasSubstr("of the mask's 221 pixels 97 are taken as selected")));
}

INSTANTIATE_TEST_SUITE_P(Programs, MaskFile,
                         ::testing::Values("mask_pillow_1bit.tif", "mask_pillow_1bit.png", "mask_pillow_1bit.bmp",
                                           "mask_pillow_group4.tif", "mask_pillow_8bit.tif", "mask_pillow_palette.png",
                                           "mask_pillow_palette.tif", "mask_big_endian_1bit.tif",
                                           "mask_white_is_zero_1bit.tif", "mask_imagej_inverting.tif",
                                           "mask_imagej_inverting_16bit.tif"));

TEST(MaskFiles, SayWhichSideOfAnInvertingTableIsTaken) {
  EXPECT_THAT(mask("mask_imagej_inverting.tif").notes, Contains(HasSubstr("not stored as 0 (white is zero")));
  EXPECT_THAT(mask("mask_white_is_zero_1bit.tif").notes, Contains(HasSubstr("shown white (white is zero")));
}

TEST(MaskFiles, OfOneBitAreNoPictures) {
  for (const char* name : {"mask_pillow_1bit.tif", "mask_pillow_group4.tif", "mask_pillow_1bit.png"}) {
    try {
      image(name);
      FAIL() << name;
    } catch (const UserError& error) {
      EXPECT_THAT(error.what(), HasSubstr("1 bit per pixel")) << name;
    }
  }
}

struct Depth {
  const char* name;
  double top;  // of the ramp of 32 steps
};
class WhiteIsZero : public ::testing::TestWithParam<Depth> {};

TEST_P(WhiteIsZero, IsTurnedRoundAtEveryDepth) {
  const LoadedImage loaded = image(GetParam().name);
  EXPECT_THAT(loaded.notes, Contains(HasSubstr("white is stored as zero: values inverted")));
  for (int i = 0; i < 32; ++i) {
    const double exact = GetParam().top * i / 31;
    // Counts are rounded; the float holds 24 bits.
    EXPECT_NEAR(loaded.values.values()[static_cast<std::size_t>(i)], exact, GetParam().top > 1 ? 0.5 : 1e-6) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Depths, WhiteIsZero,
                         ::testing::Values(Depth{"white_is_zero_2.tif", 3}, Depth{"white_is_zero_4.tif", 15},
                                           Depth{"white_is_zero_8.tif", 255}, Depth{"white_is_zero_10.tif", 1023},
                                           Depth{"white_is_zero_12.tif", 4095}, Depth{"white_is_zero_14.tif", 16383},
                                           Depth{"white_is_zero_16.tif", 65535},
                                           Depth{"white_is_zero_big_endian_16.tif", 62000},
                                           Depth{"white_is_zero_32.tif", 4294967295.0},
                                           Depth{"white_is_zero_float.tif", 1}, Depth{"white_is_zero_signed.tif", 31}),
                         [](const auto& info) {
                           std::string name = info.param.name;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace birefit
