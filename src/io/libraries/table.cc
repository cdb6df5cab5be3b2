#include "io/libraries/table.h"

extern "C" const birefit::ImageLibraries* birefit_image_libraries() {
  static const birefit::ImageLibraries table;
  return &table;
}
