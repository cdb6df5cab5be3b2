// What is written of images, and what stays of an old file where that fails.

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <sys/resource.h>
#include <unistd.h>

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "birefit/io.h"
#include "image_files.h"
#include "io/files/file.h"

namespace birefit {
namespace {

using namespace image_files;
using ::testing::IsEmpty;

class ImageWriting : public ImageFile {};

Image ramp() {
  Image image(31, 17);
  for (std::size_t i = 0; i < image.size(); ++i) image.values()[i] = static_cast<double>(i) / (image.size() - 1);
  return image;
}

TEST_F(ImageWriting, SavedPicturesStateTheirPixels) {
  for (const char* name : {"a.tif", "a.exr"}) {
    const std::vector<Image> channels{ramp()};
    EXPECT_NEAR(load(write_bytes(name, encode_channels(channels, path(name), 0.3))).pixel_size_um, 0.3, 1e-6) << name;
  }
}

TEST_F(ImageWriting, SavedFloatsAreReadBackExactlyAndAreNotHalf) {
  Image image = ramp();
  image(3, 3) = -12345.678f;
  image(4, 3) = std::numeric_limits<double>::quiet_NaN();
  for (const char* name : {"a.tif", "a.exr", "b.TIFF"}) {
    save_image(image, path(name));
    const LoadedImage loaded = load(path(name));
    EXPECT_THAT(loaded.notes, IsEmpty()) << name;
    for (int y = 0; y < image.height(); ++y)
      for (int x = 0; x < image.width(); ++x) {
        if (x == 4 && y == 3) continue;
        ASSERT_EQ(loaded.values(x, y), double{static_cast<float>(image(x, y))}) << name;
      }
    EXPECT_TRUE(std::isnan(loaded.values(4, 3))) << name;
  }
}

TEST_F(ImageWriting, SavedPngIsClampedTo16Bit) {
  Image image(4, 1);
  image.values() = {-0.5, 0.5, 1.5, std::numeric_limits<double>::quiet_NaN()};
  save_image(image, path("a.png"));
  const LoadedImage loaded = load(path("a.png"));
  EXPECT_EQ(loaded.values.values(), (std::vector<double>{0, 32768, 65535, 0}));
  EXPECT_EQ(loaded.bits, 16);
}

TEST_F(ImageWriting, UnknownExtensionListsTheKnownOnes) {
  EXPECT_THAT(message_of([&] { save_image(ramp(), path("a.bmp")); }),
              AllOf(HasSubstr("'.bmp'"), HasSubstr(".tif"), HasSubstr(".exr"), HasSubstr(".png")));
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(ImageWriting, EncodedPngIsAPng) {
  const std::vector<unsigned char> samples = {255, 0, 0, 0, 255, 0};
  const std::vector<unsigned char> png = encode_png(samples, 2, 1, 3);
  const fs::path file = write_bytes("a.png", std::string(png.begin(), png.end()));
  EXPECT_EQ(load(file, "r").values.values(), (std::vector<double>{255, 0}));
  EXPECT_EQ(load(file, "g").values.values(), (std::vector<double>{0, 255}));
}

TEST_F(ImageWriting, UnwritableFolderIsTold) {
  EXPECT_THAT(message_of([&] { write_file(path("none/a.txt"), "x"); }), HasSubstr("cannot be written: No such file"));
  EXPECT_THROW(write_file(folder_, "x"), UserError);
}

TEST_F(ImageWriting, FullDeviceIsTold) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_THAT(message_of([&] { write_file("/dev/full", "x"); }), HasSubstr("No space left on device"));
  EXPECT_TRUE(fs::exists("/dev/full"));
}

/// Lets no file grow beyond some bytes: what a full disk looks like to one process.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int);
};

TEST_F(ImageWriting, FailedWriteKeepsTheOldFileAndLeavesNoTemporary) {
  write_file(path("a.txt"), "old");
  save_image(ramp(), path("a.tif"));
  const std::string old_image = content(path("a.tif"));
  {
    FileSizeLimit limit(100);
    EXPECT_THAT(message_of([&] { write_file(path("a.txt"), std::string(1000, 'x')); }), HasSubstr("cannot be written"));
    EXPECT_THAT(message_of([&] { save_image(Image(64, 64, 0.5), path("a.tif")); }), HasSubstr("cannot be written"));
  }
  EXPECT_EQ(content(path("a.txt")), "old");
  EXPECT_EQ(content(path("a.tif")), old_image);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 2);
}

TEST_F(ImageWriting, WritingThroughALinkKeepsTheLink) {
  write_file(path("target.txt"), "old");
  fs::create_symlink("target.txt", path("link.txt"));
  write_file(path("link.txt"), "new");
  EXPECT_TRUE(fs::is_symlink(path("link.txt")));
  EXPECT_EQ(content(path("target.txt")), "new");
}

// Found by tools/fuzz: a damaged header whose size OpenImageIO believes.

}  // namespace
}  // namespace birefit
