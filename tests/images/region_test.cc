// A region of a file, and pixels of a picture that are means of several of the file: what is read, and what a config
// makes of it. Keys and parameters stay those of the file.

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "birefit/io.h"
#include "birefit/render.h"
#include "io/images/mask.h"
#include "pictures.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// Codes without a pattern that a shift would keep.
double code(int x, int y) { return (x * 7919 + y * 104729 + x * y) % 60013; }

class Region : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("birefit_region_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, int width, int height, int channels, int tile) {
    OIIO::ImageSpec spec(width, height, channels, OIIO::TypeDesc::UINT16);
    spec.tile_width = spec.tile_height = tile;
    std::vector<std::uint16_t> samples;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int c = 0; c < channels; ++c) samples.push_back(static_cast<std::uint16_t>(code(x, y) + c));
    auto output = OIIO::ImageOutput::create(name);
    EXPECT_TRUE(output->open((folder_ / name).string(), spec)) << output->geterror();
    EXPECT_TRUE(output->write_image(spec.format, samples.data())) << output->geterror();
    EXPECT_TRUE(output->close());
    return folder_ / name;
  }
  /// 32 x 32 pixels that scatter about `mean` by up to `scatter` codes.
  void write_even(const std::string& name, int mean, int scatter) {
    std::vector<std::uint16_t> samples;
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x)
        samples.push_back(
            static_cast<std::uint16_t>(mean + static_cast<int>(code(x, y)) % (2 * scatter + 1) - scatter));
    auto output = OIIO::ImageOutput::create(name);
    EXPECT_TRUE(output->open((folder_ / name).string(), OIIO::ImageSpec(32, 32, 1, OIIO::TypeDesc::UINT16)));
    EXPECT_TRUE(output->write_image(OIIO::TypeDesc::UINT16, samples.data())) << output->geterror();
    EXPECT_TRUE(output->close());
  }
  fs::path text(const std::string& name, const std::string& content) {
    std::ofstream(folder_ / name) << content;
    return folder_ / name;
  }
  std::string mistake(const std::string& config) {
    try {
      load_config(text("config.yaml", config), ConfigUse::fit);
    } catch (const UserError& error) {
      return error.what();
    }
    return {};
  }

  fs::path folder_;
};

TEST_F(Region, IsTheCropOfTheWholeToTheBit) {
  for (const auto& [name, channels, tile] :
       {std::tuple("rows.tif", 1, 0), std::tuple("tiles.tif", 1, 32), std::tuple("rows.png", 1, 0),
        std::tuple("colours.tif", 3, 16), std::tuple("colours.png", 3, 0)}) {
    const fs::path file = write(name, 150, 97, channels, tile);
    ImageRequest request{file, {}, channels == 3 ? "mean" : "", {}};
    const LoadedImage whole = load_image(request);
    EXPECT_EQ(whole.values.width(), 150);
    for (const PixelRect& region : {PixelRect{0, 0, 150, 97}, PixelRect{31, 33, 65, 64}, PixelRect{120, 90, 150, 97},
                                    PixelRect{5, 7, 6, 8}, PixelRect{-3, 60, 40, 200}}) {
      request.region = region;
      const LoadedImage part = load_image(request);
      EXPECT_EQ(part.width, 150);
      EXPECT_EQ(part.height, 97);
      EXPECT_EQ(part.x0, std::max(region.x0, 0));
      const PixelRect within{std::max(region.x0, 0), region.y0, std::min(region.x1, 150), std::min(region.y1, 97)};
      EXPECT_EQ(part.values.values(), cropped(whole.values, within).values()) << name << " " << region.x0;
    }
    request.region = PixelRect{200, 0, 210, 10};
    EXPECT_TRUE(load_image(request).values.empty());
  }
}

TEST_F(Region, OfAMaskIsCroppedAlike) {
  Image mask(40, 30, 1);
  mask(20, 11) = 0;
  save_image(mask, folder_ / "mask.tif");
  ImageRequest request{folder_ / "mask.tif", {}, "mean", {}};
  request.region = PixelRect{19, 10, 25, 14};
  const LoadedMask part = load_mask(request);
  EXPECT_EQ(part.selected.width(), 6);
  EXPECT_EQ(part.selected(1, 1), 0);
  EXPECT_EQ(part.selected(2, 1), 1);
  EXPECT_EQ(part.width, 40);
}

const std::string kDroplet = R"(sample:
  droplet: {diameter_um: {value: 9.3, fit: [8.5, 10]}, director: {radial: {}}}
  material: {ordinary: 1.52, birefringence: {value: 0.2, fit: [0.1, 0.3]}}
  surround: {index: 1.43}
microscope: {light: {wavelength_nm: 590}, polarizer_deg: 0, analyzer_deg: 90}
)";

TEST_F(Region, BinnedPixelsAreMeansAndAllOfThemCount) {
  Image image(41, 30);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 41; ++x) image(x, y) = code(x, y);
  image(7, 5) = std::nan("");
  save_image(image, folder_ / "a.tif");
  Image mask(41, 30, 1);
  mask(20, 20) = 0;
  save_image(mask, folder_ / "mask.tif");
  const Config config = load_config(
      text("c.yaml",
           "micrograph: {image: a.tif, mask: mask.tif, roi_px: [2, 3, 40, 30], bin: 3, pixel_size_um: 0.25,\n"
           "  center_px: [21.5, {value: 15, fit: [10, 20]}],\n"
           "  noise: {read_counts: 6, counts_per_photon: 0.9}}\n" +
               kDroplet),
      ConfigUse::fit);
  const Picture& picture = birefit::picture(config.job, 0);
  EXPECT_EQ(picture.values.width(), 12);  // 38 columns, of which two are left over
  EXPECT_EQ(picture.values.height(), 9);
  double sum = 0;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) sum += image(2 + 3 * 4 + i, 3 + 3 * 2 + j);
  EXPECT_DOUBLE_EQ(picture.values(4, 2), sum / 9);
  EXPECT_EQ(picture.mask(1, 0), 0);  // the pixel that is no number
  EXPECT_EQ(picture.non_finite, 1);
  EXPECT_EQ(picture.mask(6, 5), 0);  // the masked one
  EXPECT_EQ(picture.masked_by_user, 1);
  EXPECT_EQ(picture.mask(5, 5), 1);
  EXPECT_DOUBLE_EQ(picture.noise->read_counts, 2);
  EXPECT_DOUBLE_EQ(picture.noise->counts_per_photon, 0.1);
  // The parameters are the file's, the scene has the picture's pixels.
  const ParameterTable& table = config.job.parameters;
  const Theta theta = table.values();
  const View& view = picture.scene.view;
  EXPECT_EQ(table[view.center_y_px].value, 15);
  EXPECT_DOUBLE_EQ(view.center_x_px.in(theta), (21.5 - 2 - 1) / 3);
  EXPECT_DOUBLE_EQ(view.center_y_px.in(theta), (15.0 - 3 - 1) / 3);
  EXPECT_DOUBLE_EQ(view.pixel_size_um.in(theta), 0.75);
  EXPECT_EQ(table[view.pixel_size_um].value, 0.25);
}

// The law behind it: a picture of binned pixels is the mean of the whole one's, where the model's means over pixels
// hold.
TEST_F(Region, OfAModelIsThePartOfTheWholePicture) {
  const std::string view = "pixel_size_um: 0.1, center_px: [61.2, 44.7]";
  const Config whole =
      load_config(text("w.yaml", "image_size_px: [120, 96]\nmicrograph: {" + view + "}\n" + kDroplet), ConfigUse::plan);
  const Config part = load_config(
      text("p.yaml", "image_size_px: [120, 96]\nmicrograph: {roi_px: [13, 20, 93, 84], " + view + "}\n" + kDroplet),
      ConfigUse::plan);
  const Config binned =
      load_config(text("b.yaml", "image_size_px: [120, 96]\nmicrograph: {roi_px: [13, 20, 93, 84], bin: 4, " + view +
                                     "}\n" + kDroplet),
                  ConfigUse::plan);
  const auto picture = [](const Config& config) {
    const Theta theta = config.job.parameters.values();
    Demand demand = config.job.demand;
    demand.intensity_accuracy = 1e-5;
    return render(config.scene, plan(config.scene, demand, theta), theta).intensity;
  };
  const Image a = picture(whole), b = picture(part), c = picture(binned);
  ASSERT_EQ(b.width(), 80);
  ASSERT_EQ(c.width(), 20);
  double most = 0, most_binned = 0;
  for (int y = 0; y < b.height(); ++y)
    for (int x = 0; x < b.width(); ++x) most = std::max(most, std::abs(b(x, y) - a(13 + x, 20 + y)));
  for (int y = 0; y < c.height(); ++y)
    for (int x = 0; x < c.width(); ++x) {
      double sum = 0;
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) sum += b(4 * x + i, 4 * y + j);
      most_binned = std::max(most_binned, std::abs(c(x, y) - sum / 16));
    }
  EXPECT_LT(most, 3e-5);
  EXPECT_LT(most_binned, 1e-3);
}

TEST_F(Region, OfItsOwnIsEachPicturesPart) {
  write("a.tif", 64, 48, 1, 0);
  const std::string config =
      "micrograph: {pixel_size_um: 0.25, center_px: [20, 20]}\nmicrographs:\n"
      "  - {image: a.tif, roi_px: [3, 5, 40, 45]}\n  - {image: a.tif}\n" +
      std::string(kDroplet);
  const Config loaded = load_config(text("own.yaml", config), ConfigUse::fit);
  ASSERT_EQ(loaded.job.measurements.size(), 2u);
  const auto& part = std::get<Picture>(loaded.job.measurements[0]);
  const auto& whole = std::get<Picture>(loaded.job.measurements[1]);
  ASSERT_EQ(part.values.width(), 37);
  ASSERT_EQ(part.values.height(), 40);
  EXPECT_EQ(whole.values.width(), 64);
  for (int y = 0; y < part.values.height(); ++y)
    for (int x = 0; x < part.values.width(); ++x) ASSERT_EQ(part.values(x, y), whole.values(x + 3, y + 5));
  EXPECT_NE(part.name, whole.name);
  EXPECT_THAT(mistake("calibration: {dark: a.tif, parallel: a.tif}\n" + config),
              ::testing::HasSubstr("a region of its own is given beside calibration frames"));
}

// An even picture that the camera has cut off is a single code, which tells nothing of the light, and shows no noise
// that would say so. The darkest may well be one: an offset that hides the noise.
TEST_F(Region, OfOneCodeAsBrightAsAnyIsSaturated) {
  const std::string config =
      "micrographs:\n  - {image: a.tif, set: {sample.crystal.bias_v: 100}}\n"
      "  - {image: b.tif, set: {sample.crystal.bias_v: 300}}\n  - {image: c.tif, set: {sample.crystal.bias_v: 500}}\n"
      "micrograph: {gain: {fit: auto}, offset: {fit: auto}}\n"
      "sample: {crystal: {half_wave_voltage_v: {value: 700, fit: [400, 900]}, field_along: y}}\n"
      "microscope: {light: {wavelength_nm: 1550}, polarizer_deg: 0, analyzer_deg: 90}\n";
  write_even("a.tif", 3000, 20), write_even("b.tif", 14000, 40), write_even("c.tif", 25105, 0);
  EXPECT_THAT(mistake(config), ::testing::HasSubstr("c.tif: all of its pixels are 25105 counts"));
  write_even("c.tif", 25105, 50);
  EXPECT_EQ(mistake(config), "");
  write_even("a.tif", 3000, 0);
  EXPECT_EQ(mistake(config), "");
}

TEST_F(Region, WhatCannotBeBinnedIsSaid) {
  save_image(Image(32, 32, 5), folder_ / "a.tif");
  const auto with = [](const std::string& keys) {
    return "micrograph: {image: a.tif, pixel_size_um: 0.25, " + keys + "}\n" + kDroplet;
  };
  EXPECT_THAT(mistake(with("bin: 2, bayer: rggb, channel: g")), ::testing::HasSubstr("bin is given beside bayer"));
  EXPECT_THAT(mistake(with("bin: 0")), ::testing::HasSubstr("bin"));
  EXPECT_THAT(mistake(with("bin: 1.5")), ::testing::HasSubstr("bin"));
  EXPECT_THAT(mistake(with("bin: 40")), ::testing::HasSubstr("bin = 40 is more than the 32 x 32 pixels of a.tif"));
  EXPECT_THAT(mistake(with("roi_px: [4, 4, 40, 9]")), ::testing::HasSubstr("reaches outside a.tif, which is 32 x 32"));
  EXPECT_THAT(mistake(with("roi_px: [40, 40, 50, 50]")), ::testing::HasSubstr("reaches outside a.tif"));
}

}  // namespace
}  // namespace birefit
