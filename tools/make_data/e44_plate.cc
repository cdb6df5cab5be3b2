// Makes the image of data/e44_plate: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support -I/usr/include/eigen3 tools/make_data/e44_plate.cc -o make_e44 && ./make_e44

#include "independent_droplet.h"  // camera()
#include "independent_plate.h"
#include "pgm.h"

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 192;
  IndependentPlate plate;  // E44, 0.8 mm, 640 nm, 15 degrees
  plate.size_px = kSize;
  plate.fourier_number = 0.1;
  plate.prepare();
  std::vector<double> mean;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) mean.push_back(120 + 3600 * plate.pixel(column, row, 3));
  write_pgm("conoscopy.pgm", kSize, kSize, camera(mean, 0.5, 4.0, 4401));
}
