// Makes the image of data/e12_droplet: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/e12_droplet.cc -o make_e12 && ./make_e12

#include "independent_droplet.h"
#include "pgm.h"

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 256;
  IndependentDroplet drop;  // E12 in a 1.43 host, 590 nm
  drop.center_x_px = 129.3;
  drop.center_y_px = 125.8;
  std::vector<double> mean;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) mean.push_back(150 + 3200 * drop.pixel(column, row));
  const std::vector<double> counts = camera(mean, 0.5, 4.0, 20201);
  write_pgm("e12_9um.pgm", kSize, kSize, counts);
}
