// Makes the image of data/disc: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/disc.cc -o make_disc && ./make_disc

#include "independent_disc.h"
#include "independent_droplet.h"  // camera()
#include "pgm.h"

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 160;
  IndependentDisc disc;  // a disc 12 mm across, circular polariscope, green light
  disc.center_x_px = 80.4;
  disc.center_y_px = 78.7;
  disc.um_per_px = 85;
  std::vector<double> mean;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) mean.push_back(90 + 3300 * disc.pixel(column, row, 24));
  write_pgm("disc.pgm", kSize, kSize, camera(mean, 0.5, 4.0, 3107));
}
