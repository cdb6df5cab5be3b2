#pragma once
// All that needs OpenImageIO and OpenCV. They bring 240 shared libraries, which take longer to load than many a fit
// takes, so the program opens them with the first image (src/io/libraries/opened): this folder is then a library of
// its own, known by the table below. The library birefit::io has the same functions linked in.

#include <filesystem>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/files/file.h"

namespace birefit {

/// Median of the 5 x 5 neighbours of every pixel; beyond an edge its pixels go on.
Grid<float> median_of_neighbours(const Grid<float>& values);

/// What load_image() promises, of a file that is there and has bytes in one of the formats of OpenImageIO.
LoadedImage load_by_libraries(const ImageRequest& request);

struct ImageLibraries {
  const char* version = BIREFIT_VERSION;  ///< of birefit; the rest is known only where it is the program's
  decltype(&birefit::load_by_libraries) load_by_libraries = &birefit::load_by_libraries;
  decltype(&birefit::encode_channels) encode_channels = &birefit::encode_channels;
  decltype(&birefit::encode_png) encode_png = &birefit::encode_png;
  decltype(&birefit::find_disc) find_disc = &birefit::find_disc;
  decltype(&birefit::median_of_neighbours) median_of_neighbours = &birefit::median_of_neighbours;
};

}  // namespace birefit

/// The table of the library that the program opens.
extern "C" const birefit::ImageLibraries* birefit_image_libraries();
