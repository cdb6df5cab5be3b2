// What is read of image files. Every test writes its own (image_files.h).

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "birefit/io.h"
#include "image_files.h"

namespace birefit {
namespace {

using namespace image_files;
using ::testing::Contains;
using ::testing::IsEmpty;

// ---- values ---------------------------------------------------------------------------------------------------------

TEST_F(ImageFile, KeepsCountsOf8BitPng) {
  const LoadedImage image = load(write<std::uint8_t>("a.png", {3, 2, 1, TypeDesc::UINT8}, {0, 1, 2, 127, 128, 255}));
  EXPECT_EQ(image.values.values(), (std::vector<double>{0, 1, 2, 127, 128, 255}));
  EXPECT_EQ(image.values.width(), 3);
  EXPECT_EQ(image.bits, 8);
  EXPECT_EQ(image.top_code, 255);
  EXPECT_EQ(image.pixel_size_um, 0);
  EXPECT_THAT(image.notes, IsEmpty());
}

TEST_F(ImageFile, KeepsCountsOf16BitPngAndTiff) {
  for (const char* name : {"a.png", "a.tif"}) {
    const LoadedImage image = load(write<std::uint16_t>(name, {2, 2, 1, TypeDesc::UINT16}, {0, 1, 4095, 65535}));
    EXPECT_EQ(image.values.values(), (std::vector<double>{0, 1, 4095, 65535})) << name;
    EXPECT_EQ(image.bits, 16) << name;
    EXPECT_EQ(image.top_code, 65535) << name;
  }
}

TEST_F(ImageFile, KeepsFloatsOfTiffAndExrNanIncluded) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const char* name : {"a.tif", "a.exr"}) {
    const LoadedImage image = load(write<float>(name, {2, 2, 1, TypeDesc::FLOAT}, {-1.5f, 3e6f, nan, 0.1f}));
    EXPECT_EQ(image.values(0, 0), -1.5) << name;
    EXPECT_EQ(image.values(1, 0), 3e6) << name;
    EXPECT_TRUE(std::isnan(image.values(0, 1))) << name;
    EXPECT_EQ(image.values(1, 1), double{0.1f}) << name;
    EXPECT_EQ(image.bits, 32) << name;
    EXPECT_EQ(image.top_code, 0) << name;
  }
}

TEST_F(ImageFile, ReadsHalfFloatExrWithANote) {
  const LoadedImage image = load(write<float>("a.exr", {2, 1, 1, TypeDesc::FLOAT}, {0.5f, 2}));
  EXPECT_THAT(image.notes, IsEmpty());
  ImageSpec half(2, 1, 1, TypeDesc::HALF);
  auto output = OIIO::ImageOutput::create("h.exr");
  const std::vector<float> samples = {0.5f, 2};
  ASSERT_TRUE(output->open(path("h.exr").string(), half) && output->write_image(TypeDesc::FLOAT, samples.data()) &&
              output->close());
  const LoadedImage coarse = load(path("h.exr"));
  EXPECT_EQ(coarse.values.values(), (std::vector<double>{0.5, 2}));
  EXPECT_THAT(coarse.notes, Contains(HasSubstr("three decimal digits")));
}

TEST_F(ImageFile, ReadsSignedAndWideIntegersAsFloatWithANote) {
  const LoadedImage negative = load(write<std::int16_t>("a.tif", {2, 1, 1, TypeDesc::INT16}, {-300, 32767}));
  EXPECT_EQ(negative.values.values(), (std::vector<double>{-300, 32767}));
  EXPECT_EQ(negative.bits, 32);
  EXPECT_EQ(negative.top_code, 0);
  EXPECT_THAT(negative.notes, Contains(HasSubstr("16-bit signed integer: read as float")));
  const LoadedImage wide = load(write<std::uint32_t>("b.tif", {2, 1, 1, TypeDesc::UINT32}, {70000, 4294967295u}));
  EXPECT_EQ(wide.values.values(), (std::vector<double>{70000, 4294967295.0}));
}

TEST_F(ImageFile, ReadsTiledTiff) {
  ImageSpec spec(100, 70, 1, TypeDesc::UINT16);
  const auto samples = noise(7000);
  spec.tile_width = spec.tile_height = 64;
  const LoadedImage image = load(write("a.tif", spec, samples));
  EXPECT_EQ(image.values.values(), std::vector<double>(samples.begin(), samples.end()));
}

// OpenImageIO 2.4 hands out parts of such strips as zeros, and tiles as whatever memory held.
TEST_F(ImageFile, Reads64BitFloatTiffWholeOrInPartAndRefusesTiles) {
  std::vector<double> samples(60 * 46);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = 100 + 0.37 * static_cast<double>(i);
  ImageSpec spec(60, 46, 1, TypeDesc::DOUBLE);
  for (const int rows : {1, 7, 46}) {
    spec.attribute("tiff:RowsPerStrip", rows);
    const fs::path file = write("a.tif", spec, samples);
    EXPECT_EQ(load(file).values.values(), samples) << rows;
    for (const PixelRect part : {PixelRect{0, 5, 60, 41}, PixelRect{0, 7, 60, 42}, PixelRect{3, 0, 9, 2}}) {
      ImageRequest request{file, {}, {}, {"job.yaml", 3, 5}};
      request.region = part;
      const LoadedImage image = load_image(request);
      for (int y = part.y0; y < part.y1; ++y)
        for (int x = part.x0; x < part.x1; ++x)
          ASSERT_EQ(image.values(x - image.x0, y - image.y0), samples[static_cast<std::size_t>(60 * y + x)])
              << rows << ", " << x << ", " << y;
    }
  }
  spec.tile_width = spec.tile_height = 16;
  const fs::path tiled = write("tiled.tif", spec, samples);
  EXPECT_THAT(message_of([&] { load(tiled); }), HasSubstr("64-bit float samples in tiles"));
}

// Layers of a renderer: the one without a name is the picture.
TEST_F(ImageFile, OfSeveralLayersTheOneWithoutANameIsThePicture) {
  const auto layers = [&](std::vector<std::string> names) {
    ImageSpec spec(2, 1, static_cast<int>(names.size()), TypeDesc::FLOAT);
    spec.channelnames = std::move(names);
    std::vector<float> samples(2 * static_cast<std::size_t>(spec.nchannels));
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<float>(i % samples.size());
    return write("a.exr", spec, samples);
  };
  for (const auto& names : {std::vector<std::string>{"R", "G", "B", "diffuse.R", "diffuse.G", "diffuse.B"},
                            std::vector<std::string>{"AO.R", "AO.G", "AO.B", "R", "G", "B"}}) {
    const fs::path file = layers(names);
    const auto input = OIIO::ImageInput::open(file.string());  // stored in an order of its own
    const auto& stored = input->spec().channelnames;
    const auto at = std::find(stored.begin(), stored.end(), "R") - stored.begin();
    std::vector<float> all(12);
    ASSERT_TRUE(input->read_image(0, 0, 0, 6, TypeDesc::FLOAT, all.data()));
    EXPECT_EQ(load(file, "r").values(0, 0), all[static_cast<std::size_t>(at)]) << names[0];
  }
  const fs::path both = layers({"left.R", "left.G", "left.B", "right.R", "right.G", "right.B"});
  EXPECT_THAT(message_of([&] { load(both, "r"); }), HasSubstr("several layers of colours"));
}

TEST_F(ImageFile, RestoresCountsOfPacked12BitTiff) {
  ImageSpec spec(64, 64, 1, TypeDesc::UINT16);
  spec.attribute("oiio:BitsPerSample", 12);
  std::vector<std::uint16_t> counts(4096), expanded(4096);
  for (int i = 0; i < 4096; ++i)
    counts[i] = i, expanded[i] = static_cast<std::uint16_t>(std::lround(i * 65535.0 / 4095));
  const LoadedImage image = load(write("a.tif", spec, expanded));
  EXPECT_EQ(image.values.values(), std::vector<double>(counts.begin(), counts.end()));
  EXPECT_EQ(image.top_code, 4095);
  EXPECT_THAT(image.notes, Contains(HasSubstr("12-bit samples")));
}

// Colours of 14 bits are handed out as 16: each is a count again before they are averaged.
TEST_F(ImageFile, MeansOfPackedColoursAreMeansOfCounts) {
  constexpr int kPixels = 512;
  ImageSpec spec(kPixels, 1, 3, TypeDesc::UINT16);
  spec.attribute("oiio:BitsPerSample", 14);
  std::vector<std::uint16_t> expanded;
  std::vector<double> means;
  for (int i = 0; i < kPixels; ++i) {
    const int counts[3] = {31 * i, 29 * i + 7, 16383 - 13 * i};
    for (const int c : counts) expanded.push_back(static_cast<std::uint16_t>(std::lround(c * 65535.0 / 16383)));
    means.push_back((counts[0] + counts[1] + counts[2]) / 3.0);
  }
  const LoadedImage image = load(write("a.tif", spec, expanded), "mean");
  for (int i = 0; i < kPixels; ++i) EXPECT_NEAR(image.values(i, 0), means[static_cast<std::size_t>(i)], 1e-9) << i;
}

// Of a stack of MetaMorph one directory stands for all planes, as many as its UIC2Tag has entries (of six numbers
// each).
TEST_F(ImageFile, AStackOfMetaMorphIsNoSinglePicture) {
  std::vector<Tag> tags = tiff_tags(2, 1, 8, 1);
  tags.push_back({33629, 5, {}});
  std::string bytes = tiff_bytes(tags, std::string("\x05\x06", 2));
  const std::size_t entry = bytes.find("\x5d\x83");  // 33629, count and place behind its type
  ASSERT_NE(entry, std::string::npos);
  bytes[entry + 4] = 3;
  bytes[entry + 8] = static_cast<char>(bytes.size());
  bytes += std::string(3 * 24, '\0');
  const fs::path file = write_bytes("a.stk", bytes);
  EXPECT_THAT(refusal(file), AllOf(HasSubstr("MetaMorph"), HasSubstr("3 planes"), HasSubstr("`page: 0`")));
  const LoadedImage first = load(file, "", 0);
  EXPECT_EQ(first.values(1, 0), 6);
  EXPECT_THAT(first.notes, Contains(HasSubstr("the first is used")));
}

TEST_F(ImageFile, RestoresCountsOf4BitGreyPng) {
  const LoadedImage image = load(write_bytes("a.png", png_bytes(2, 2, 4, 0, std::string("\0\x1f\0\x0a", 4))));
  EXPECT_EQ(image.values.values(), (std::vector<double>{1, 15, 0, 10}));
  EXPECT_EQ(image.top_code, 15);
}

TEST_F(ImageFile, InvertsWhiteIsZeroTiffWithANote) {
  const LoadedImage image = load(write_bytes("a.tif", tiff_bytes(tiff_tags(2, 1, 8, 0), std::string("\x00\xf0", 2))));
  EXPECT_EQ(image.values.values(), (std::vector<double>{255, 15}));
  EXPECT_THAT(image.notes, Contains(HasSubstr("white is stored as zero")));
}

TEST_F(ImageFile, TrustsContentOverExtension) {
  const fs::path png = write<std::uint8_t>("a.png", {2, 1, 1, TypeDesc::UINT8}, {7, 9});
  fs::rename(png, path("a.tif"));
  EXPECT_EQ(load(path("a.tif")).values.values(), (std::vector<double>{7, 9}));
}

// ---- channels and pages ---------------------------------------------------------------------------------------------

TEST_F(ImageFile, ColourNeedsAChoiceOfChannel) {
  const fs::path file = write<std::uint8_t>("a.png", {2, 1, 3, TypeDesc::UINT8}, {10, 20, 60, 1, 2, 4});
  EXPECT_THAT(refusal(file), AllOf(HasSubstr("colour channels (R, G, B) and none is chosen"), HasSubstr("mean")));
  EXPECT_EQ(load(file, "r").values.values(), (std::vector<double>{10, 1}));
  EXPECT_EQ(load(file, "g").values.values(), (std::vector<double>{20, 2}));
  EXPECT_EQ(load(file, "b").values.values(), (std::vector<double>{60, 4}));
  EXPECT_EQ(load(file, "mean").values(0, 0), 30);
  EXPECT_NEAR(load(file, "mean").values(1, 0), 7.0 / 3, 1e-15);
  EXPECT_THAT(message_of([&] { (void)load(file, "y"); }), HasSubstr("'y' is none of r, g, b, mean"));
}

TEST_F(ImageFile, AlphaIsIgnoredAndDoesNotScaleTheCounts) {
  for (const char* name : {"a.png", "a.tif"}) {
    ImageSpec spec(1, 1, 4, TypeDesc::UINT8);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    const LoadedImage image = load(write<std::uint8_t>(name, spec, {100, 150, 200, 10}), "g");
    EXPECT_EQ(image.values(0, 0), 150) << name;
    EXPECT_THAT(image.notes, Contains("alpha channel ignored")) << name;
  }
}

TEST_F(ImageFile, GreyWithAlphaNeedsNoChannel) {
  ImageSpec spec(1, 1, 2, TypeDesc::UINT16);
  spec.channelnames = {"Y", "A"};
  spec.alpha_channel = 1;
  spec.attribute("oiio:UnassociatedAlpha", 1);
  const LoadedImage image = load(write<std::uint16_t>("a.png", spec, {1234, 7}));
  EXPECT_EQ(image.values(0, 0), 1234);
  EXPECT_THAT(image.notes, Contains("alpha channel ignored"));
}

TEST_F(ImageFile, ChannelOfGreyImageHasNoEffectAndSaysSo) {
  const LoadedImage image = load(write<std::uint8_t>("a.png", {1, 1, 1, TypeDesc::UINT8}, {5}), "g");
  EXPECT_EQ(image.values(0, 0), 5);
  EXPECT_THAT(image.notes, Contains(HasSubstr("the image is grey")));
}

TEST_F(ImageFile, SeveralPagesAreListedWithTheirSizes) {
  const fs::path file = write_pages("a.tif", {{8, 6, 1, TypeDesc::UINT16}, {4, 3, 1, TypeDesc::FLOAT}});
  EXPECT_THAT(refusal(file), AllOf(HasSubstr("has 2 pages and none is chosen"), HasSubstr("0: 8 x 6"),
                                   HasSubstr("1: 4 x 3, 1 channel, 32-bit float"), HasSubstr("`page: 0`")));
  EXPECT_EQ(load(file, "", 0).values.width(), 8);
  EXPECT_EQ(load(file, "", 1).values.width(), 4);
  EXPECT_FLOAT_EQ(load(file, "", 1).values(0, 0), 0.2f);
  EXPECT_THAT(refusal(file, "", 2), AllOf(HasSubstr("has no page 2"), HasSubstr("2 pages")));
  EXPECT_THAT(refusal(file, "", -1), HasSubstr("has no page -1"));
}

TEST_F(ImageFile, PartsOfExrArePages) {
  ImageSpec first(8, 6, 1, TypeDesc::FLOAT), second(8, 6, 1, TypeDesc::FLOAT);
  first.attribute("oiio:subimagename", "one");
  second.attribute("oiio:subimagename", "two");
  const fs::path file = write_pages("a.exr", {first, second});
  EXPECT_THAT(refusal(file), HasSubstr("has 2 pages"));
  EXPECT_FLOAT_EQ(load(file, "", 1).values(3, 3), 0.2f);
}

TEST_F(ImageFile, PageZeroOfASinglePageIsFine) {
  EXPECT_EQ(load(write<std::uint8_t>("a.tif", {1, 1, 1, TypeDesc::UINT8}, {5}), "", 0).values(0, 0), 5);
}

TEST_F(ImageFile, PaletteIsExpandedToColoursWithANote) {
  const std::string palette("\x10\x20\x30\xff\xff\x00", 6);
  const fs::path png = write_bytes("a.png", png_bytes(2, 1, 8, 3, std::string("\0\0\1", 3), palette));
  EXPECT_THAT(refusal(png), AllOf(HasSubstr("colour channels"), HasSubstr("expanded from a palette")));
  const LoadedImage image = load(png, "g");
  EXPECT_EQ(image.values.values(), (std::vector<double>{0x20, 0xff}));
  EXPECT_THAT(image.notes, Contains(HasSubstr("palette")));

  std::vector<Tag> tags = tiff_tags(2, 1, 8, 3);
  std::vector<std::uint32_t> map(768);
  for (std::uint32_t i = 0; i < 256; ++i) map[i] = i * 257, map[256 + i] = (255 - i) * 257, map[512 + i] = 0;
  tags.push_back({320, 3, map});
  const fs::path tiff = write_bytes("a.tif", tiff_bytes(tags, std::string("\x03\xc8", 2)));
  EXPECT_THAT(refusal(tiff), HasSubstr("expanded from a palette"));
  EXPECT_EQ(load(tiff, "r").values.values(), (std::vector<double>{3, 200}));
  EXPECT_EQ(load(tiff, "g").values.values(), (std::vector<double>{252, 55}));
  EXPECT_THAT(load(tiff, "g").notes, Contains(HasSubstr("palette")));
}

// ---- refused --------------------------------------------------------------------------------------------------------

TEST_F(ImageFile, MissingFileFolderAndEmptyFileAreTold) {
  EXPECT_THAT(refusal(path("none.tif")), HasSubstr("does not exist"));
  EXPECT_THAT(refusal(folder_), HasSubstr("is a folder"));
  EXPECT_THAT(refusal(write_bytes("a.tif", "")), HasSubstr("is empty (zero bytes)"));
  EXPECT_THAT(refusal(write_bytes("b.tif", "hello, this is text")), HasSubstr("no image of a kind birefit reads"));
  EXPECT_THAT(refusal(write_bytes("c.png", "\x89PNG\r\n\x1a\n")), HasSubstr("truncated"));
  EXPECT_THAT(refusal(write_bytes("d.tif", std::string("II*\0\xff\xff\xff\x7f", 8))),
              HasSubstr("truncated or damaged"));
}

TEST_F(ImageFile, TruncatedAtAnyPlaceIsTruncatedInEveryFormat) {
  const auto samples = noise(128 * 128);
  ImageSpec plain(128, 128, 1, TypeDesc::UINT16);
  std::vector<fs::path> files = {write("a.png", plain, samples), write("z.exr", plain, samples)};
  for (const char* compression : {"none", "lzw", "zip"}) {
    plain.attribute("compression", compression);
    files.push_back(write(std::string(compression) + ".tif", plain, samples));
  }
  files.push_back(write("a.jpg", ImageSpec(128, 128, 1, TypeDesc::UINT8),
                        std::vector<std::uint8_t>(samples.begin(), samples.end())));
  for (const fs::path& file : files) {
    EXPECT_EQ(load(file).values.width(), 128) << file;
    for (const double fraction : {0.02, 0.3, 0.6, 0.9, 0.99})
      EXPECT_THAT(refusal(truncated(file, fraction)), HasSubstr("truncated")) << file << " cut at " << fraction;
  }
}

TEST_F(ImageFile, DamagedDataIsRefused) {
  const fs::path file = write("a.png", ImageSpec(64, 64, 1, TypeDesc::UINT16), noise(4096));
  std::string bytes = content(file);
  bytes[bytes.size() / 2] ^= 0x55;
  EXPECT_THAT(refusal(write_bytes("b.png", bytes)), HasSubstr("truncated or damaged"));
}

TEST_F(ImageFile, OneBitIsRefused) {
  EXPECT_THAT(refusal(write_bytes("a.png", png_bytes(8, 1, 1, 0, std::string("\0\xaa", 2)))),
              HasSubstr("1 bit per pixel"));
  EXPECT_THAT(refusal(write_bytes("a.tif", tiff_bytes(tiff_tags(8, 1, 1, 1), "\xaa"))), HasSubstr("1 bit per pixel"));
}

TEST_F(ImageFile, AnimationsAreRefused) {
  const std::string animation = png_chunk("acTL", std::string("\0\0\0\2\0\0\0\0", 8));
  EXPECT_THAT(refusal(write_bytes("a.png", png_bytes(2, 1, 8, 0, std::string("\0\1\2", 3), {}, animation))),
              HasSubstr("is animated (PNG)"));
  const ImageSpec frame(16, 16, 3, TypeDesc::UINT8);
  EXPECT_THAT(refusal(write_pages("a.gif", {frame, frame})), HasSubstr("is animated (GIF)"));
  std::string webp = "RIFF....WEBPVP8X" + std::string("\x0a\0\0\0\x02\0\0\0\1\0\0\1\0\0", 14) + std::string(16, '\0');
  EXPECT_THAT(refusal(write_bytes("a.webp", webp)), HasSubstr("is animated (WebP)"));
}

TEST_F(ImageFile, AStillGifIsAPaletteImage) {
  const fs::path file = write<std::uint8_t>("a.gif", {2, 2, 3, TypeDesc::UINT8}, std::vector<std::uint8_t>(12, 100));
  EXPECT_THAT(refusal(file), HasSubstr("palette"));
  EXPECT_THAT(load(file, "mean").notes, Contains(HasSubstr("palette")));
}

TEST_F(ImageFile, TooLargeIsRefusedFromTheHeaderAlone) {
  const std::string png = png_bytes(20000, 20000, 16, 0, std::string(16, '\0'));
  EXPECT_THAT(refusal(write_bytes("a.png", png)), HasSubstr("is 20000 x 20000 pixels; at most 16384 on a side"));
  const std::string tiff = tiff_bytes(tiff_tags(16385, 2, 16, 1), std::string(16, '\0'));
  EXPECT_THAT(refusal(write_bytes("a.tif", tiff)), HasSubstr("is 16385 x 2 pixels"));
}

TEST_F(ImageFile, HugeHeaderOnFewBytesIsTruncatedNotAllocated) {
  const std::string tiff = tiff_bytes(tiff_tags(16384, 16384, 16, 1), std::string(16, '\0'));
  EXPECT_THAT(refusal(write_bytes("a.tif", tiff)), HasSubstr("truncated or damaged"));
}

TEST_F(ImageFile, CmykIsRefused) {
  std::vector<Tag> tags = tiff_tags(1, 1, 8, 5);
  for (Tag& tag : tags) {
    if (tag.id == 277) tag.values = {4};
    if (tag.id == 258) tag.values = {8, 8, 8, 8};
  }
  EXPECT_THAT(refusal(write_bytes("a.tif", tiff_bytes(tags, "abcd")), "g"), HasSubstr("colour space"));
}

// ---- pixel size -----------------------------------------------------------------------------------------------------

ImageSpec with_resolution(double x, double y, const std::string& unit, const std::string& description = {}) {
  ImageSpec spec(2, 2, 1, TypeDesc::UINT8);
  spec.attribute("XResolution", static_cast<float>(x));
  spec.attribute("YResolution", static_cast<float>(y));
  spec.attribute("ResolutionUnit", unit);
  if (!description.empty()) spec.attribute("ImageDescription", description);
  return spec;
}

TEST_F(ImageFile, DotsPerInchMeantForPaperAreNotAPixelSize) {
  const std::vector<std::uint8_t> samples = {1, 2, 3, 4};
  for (const double dpi : {72.0, 96.0, 300.0, 600.0})
    EXPECT_EQ(load(write("a.tif", with_resolution(dpi, dpi, "in"), samples)).pixel_size_um, 0) << dpi;
  EXPECT_NEAR(load(write("a.tif", with_resolution(254000, 254000, "in"), samples)).pixel_size_um, 0.1, 1e-6);
  EXPECT_NEAR(load(write("a.tif", with_resolution(200000, 200000, "cm"), samples)).pixel_size_um, 0.05, 1e-6);
}

TEST_F(ImageFile, ImageJUnitIsTrusted) {
  const std::vector<std::uint8_t> samples = {1, 2, 3, 4};
  for (const char* unit : {"micron", "um", "\\u00B5m", "\xc2\xb5m"}) {
    const std::string description = std::string("ImageJ=1.53t\nunit=") + unit + "\nmin=0\nmax=255\n";
    const LoadedImage image = load(write("a.tif", with_resolution(20, 20, "none", description), samples));
    EXPECT_NEAR(image.pixel_size_um, 0.05, 1e-6) << unit;
    EXPECT_THAT(image.notes, Contains(HasSubstr("ImageJ metadata")));
  }
  const std::string mm = "ImageJ=1.53t\nunit=mm\n";
  EXPECT_NEAR(load(write("a.tif", with_resolution(20000, 20000, "none", mm), samples)).pixel_size_um, 0.05, 1e-6);
  const std::string pixels = "ImageJ=1.53t\nunit=pixel\n";
  EXPECT_EQ(load(write("a.tif", with_resolution(1, 1, "none", pixels), samples)).pixel_size_um, 0);
}

TEST_F(ImageFile, OmePhysicalSizeIsTrustedAndItsUnitDefaultsToMicrometres) {
  const std::vector<std::uint8_t> samples = {1, 2, 3, 4};
  const auto ome = [](const std::string& attributes) {
    return "<?xml version=\"1.0\"?><OME xmlns=\"x\"><Image ID=\"Image:0\"><Pixels ID=\"Pixels:0\" " + attributes +
           " SizeX=\"2\"/></Image></OME>";
  };
  const auto size = [&](const std::string& attributes) {
    return load(write("a.tif", with_resolution(72, 72, "in", ome(attributes)), samples)).pixel_size_um;
  };
  EXPECT_DOUBLE_EQ(size("PhysicalSizeX=\"0.065\" PhysicalSizeY=\"0.065\""), 0.065);
  EXPECT_DOUBLE_EQ(size("PhysicalSizeX=\"65\" PhysicalSizeXUnit=\"nm\""), 0.065);
  EXPECT_DOUBLE_EQ(size("PhysicalSizeX=\"0.065\" PhysicalSizeXUnit=\"\xc2\xb5m\""), 0.065);
  // As Python's ElementTree writes it.
  EXPECT_DOUBLE_EQ(size("PhysicalSizeX=\"0.065\" PhysicalSizeXUnit=\"&#181;m\""), 0.065);
  EXPECT_DOUBLE_EQ(size("PhysicalSizeX=\"0.065\" PhysicalSizeXUnit=\"&#xB5;m\""), 0.065);
  EXPECT_EQ(size("PhysicalSizeX=\"1\" PhysicalSizeXUnit=\"Mm\""), 0);
  EXPECT_EQ(size("PhysicalSizeX=\"1\" PhysicalSizeXUnit=\"pixel\""), 0);
  EXPECT_EQ(size("PhysicalSizeX=\"0.1\" PhysicalSizeY=\"0.2\""), 0) << "not square";
}

// Of several objectives the one that was used; numbers that channels do not share are nobody's.
TEST_F(ImageFile, OmeStatesTheObjectiveAndTheLight) {
  const std::vector<std::uint8_t> samples = {1, 2, 3, 4};
  const auto loaded = [&](const std::string& instrument, const std::string& channels) {
    const std::string ome = "<?xml version=\"1.0\"?><OME xmlns=\"x\"><Instrument>" + instrument +
                            "</Instrument><Image ID=\"Image:0\"><ObjectiveSettings ID=\"Objective:1\"/>" +
                            "<Pixels ID=\"Pixels:0\" SizeX=\"2\">" + channels + "</Pixels></Image></OME>";
    return load(write("a.tif", with_resolution(72, 72, "in", ome), samples));
  };
  const std::string two =
      "<Objective ID=\"Objective:0\" LensNA=\"0.4\"/><Objective ID=\"Objective:1\" LensNA=\"0.75\"/>";
  const LoadedImage one = loaded(two, "<Channel ID=\"Channel:0\" EmissionWavelength=\"546.1\"/>");
  EXPECT_DOUBLE_EQ(one.objective_na, 0.75);
  EXPECT_DOUBLE_EQ(one.emission_nm, 546.1);
  EXPECT_NEAR(loaded("", "<Channel EmissionWavelength=\"0.59\" EmissionWavelengthUnit=\"\xc2\xb5m\"/>").emission_nm,
              590, 1e-9);
  const LoadedImage none = loaded("", "<Channel EmissionWavelength=\"450\"/><Channel EmissionWavelength=\"590\"/>");
  EXPECT_EQ(none.objective_na, 0);
  EXPECT_EQ(none.emission_nm, 0);
}

// OME, ImageJ and tifffile say in the first page what all of a stack are; a page of another size, a thumbnail, is not
// meant, and what a page says itself counts.
TEST_F(ImageFile, PagesOfAStackAreWhatTheFirstSays) {
  const std::string ome =
      "<?xml version=\"1.0\"?><OME xmlns=\"x\"><Image ID=\"Image:0\"><Pixels ID=\"Pixels:0\" "
      "SizeX=\"4\" PhysicalSizeX=\"0.3\" PhysicalSizeY=\"0.3\"><Channel EmissionWavelength=\"633\"/>"
      "</Pixels></Image></OME>";
  ImageSpec first(4, 3, 1, TypeDesc::UINT8), plain = first, thumbnail(2, 2, 1, TypeDesc::UINT8), own = first;
  first.attribute("ImageDescription", ome);
  own.attribute("XResolution", 100000.f), own.attribute("YResolution", 100000.f), own.attribute("ResolutionUnit", "cm");
  own.attribute("ImageDescription", "by itself");
  const fs::path file = write_pages("a.tif", {first, plain, thumbnail, own});
  const auto page = [&](int number) { return load_image({file, number, "", {}}); };
  for (const int number : {0, 1}) {
    EXPECT_NEAR(page(number).pixel_size_um, 0.3, 1e-9) << number;
    EXPECT_NEAR(page(number).emission_nm, 633, 1e-9) << number;
  }
  EXPECT_EQ(page(2).pixel_size_um, 0);
  EXPECT_NEAR(page(3).pixel_size_um, 0.1, 1e-6);
}

// A copy that broke off behind the first page is no single picture, unless that page is what is asked for.
TEST_F(ImageFile, AStackThatIsCutBehindItsFirstPageIsCut) {
  const ImageSpec page(4, 3, 1, TypeDesc::UINT8);
  std::string bytes = content(write_pages("a.tif", {page, page}));
  const auto number = [&](std::size_t at, int size) {
    std::size_t value = 0;
    for (int i = size; i-- > 0;)
      value = value << 8 | static_cast<unsigned char>(bytes[at + static_cast<std::size_t>(i)]);
    return value;
  };
  ASSERT_EQ(bytes.substr(0, 2), "II");
  const std::size_t first = number(4, 4), second = number(first + 2 + 12 * number(first, 2), 4);
  ASSERT_GT(second, first);
  const fs::path cut = write_bytes("cut.tif", bytes.substr(0, second));
  EXPECT_THAT(refusal(cut), ::testing::AllOf(HasSubstr("further pages are announced"), HasSubstr("page: 0")));
  EXPECT_EQ(load_image({cut, 0, "", {}}).values.width(), 4);
}

// What is whole and stored otherwise is not called damaged.
TEST_F(ImageFile, UnknownCompressionsAndTypesAreNamed) {
  std::vector<Tag> compressed = tiff_tags(4, 4, 16, 1), wide = tiff_tags(4, 4, 64, 1);
  compressed[3].values = {12345};
  wide.push_back({339, 3, {2}});
  EXPECT_THAT(refusal(write_bytes("a.tif", tiff_bytes(compressed, std::string(32, '\1')))),
              HasSubstr("compressed in a way"));
  EXPECT_THAT(refusal(write_bytes("a.tif", tiff_bytes(wide, std::string(128, '\1')))), HasSubstr("64-bit integers"));
}

TEST_F(ImageFile, AlphaThatIsAskedForIsSaid) {
  ImageSpec spec(1, 1, 4, TypeDesc::UINT8);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  const LoadedImage image = load(write<std::uint8_t>("a.png", spec, {100, 150, 200, 10}), "3");
  EXPECT_EQ(image.values(0, 0), 10);
  EXPECT_THAT(image.notes, Contains(HasSubstr("channel 3 is called A")));
  EXPECT_THAT(image.notes, ::testing::Not(Contains("alpha channel ignored")));
}

TEST_F(ImageFile, AStillWebPIsRead) {
  const std::vector<std::uint8_t> samples(16 * 12 * 3, 77);
  EXPECT_NEAR(load(write("a.webp", ImageSpec(16, 12, 3, TypeDesc::UINT8), samples), "g").values(5, 5), 77, 1);
}

TEST_F(ImageFile, AHeaderThatNoMemoryHoldsIsRefused) {
  const std::vector<unsigned char> bytes = {
      71,  73,  70,  56,  72,  78,  73,  147, 68,  82,  85,  77,  80,  89,  1,   0,   118, 0,   123, 39,  100, 101, 115,
      99,  114, 39,  58,  32,  39,  187, 136, 166, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132,
      132, 132, 133, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132,
      132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 132, 63,  235, 200, 165, 215, 140, 211, 159};
  try {
    load_image({write_bytes("a.gif", std::string(bytes.begin(), bytes.end())), {}, "", {"c.yaml", 3, 1}});
    FAIL();
  } catch (const UserError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no memory holds"));
  }
}

}  // namespace
}  // namespace birefit
