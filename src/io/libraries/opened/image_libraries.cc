// The functions of io that need OpenImageIO and OpenCV, in the program and in Python's module: each opens what has them
// when it is first called, so that what touches no image starts without those libraries.

#include <cstring>

#include <dlfcn.h>
#include <fmt/format.h>

#include "io/libraries/table.h"

namespace birefit {
namespace {

constexpr const char* kFile = "libbirefit_images.so";

const ImageLibraries& open_libraries() {
  const auto refuse = [](const std::string& what) -> void {
    throw UserError({kFile}, what, "it belongs beside birefit or below its lib folder: install birefit again");
  };
  // Looked for where the program's own run path says. Never closed: exceptions and images of it live on.
  void* const library = ::dlopen(kFile, RTLD_LAZY | RTLD_LOCAL);
  if (!library) refuse(fmt::format("what reads and writes images cannot be opened ({})", ::dlerror()));
  const auto table = reinterpret_cast<decltype(&birefit_image_libraries)>(::dlsym(library, "birefit_image_libraries"));
  if (!table || std::strcmp(table()->version, BIREFIT_VERSION) != 0)
    refuse(fmt::format("what reads and writes images is not of this birefit, {}", BIREFIT_VERSION));
  return *table();
}

const ImageLibraries& libraries() {
  static const ImageLibraries& opened = open_libraries();
  return opened;
}

}  // namespace

LoadedImage load_by_libraries(const ImageRequest& request) { return libraries().load_by_libraries(request); }

std::string encode_channels(std::span<const Image> channels, const std::filesystem::path& path, double pixel_size_um) {
  return libraries().encode_channels(channels, path, pixel_size_um);
}

std::vector<unsigned char> encode_png(const std::vector<unsigned char>& samples, int width, int height, int channels) {
  return libraries().encode_png(samples, width, height, channels);
}

DiscGuess find_disc(const Image& values, const Mask& mask) { return libraries().find_disc(values, mask); }

Grid<float> median_of_neighbours(const Grid<float>& values) { return libraries().median_of_neighbours(values); }

}  // namespace birefit
