// Makes the images of data/twisted_cell: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/twisted_cell.cc -o make_cell && ./make_cell

#include <string>

#include "independent_cell.h"
#include "independent_droplet.h"  // camera()
#include "pgm.h"

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 32;
  const IndependentCell cell;
  unsigned long seed = 9001;
  const auto shot = [&](const std::string& name, double intensity) {
    const std::vector<double> mean(kSize * kSize, 80 + 3000 * intensity);
    write_pgm((name + ".pgm").c_str(), kSize, kSize, camera(mean, 0.5, 4.0, seed++));
  };
  for (const auto& [p, a] : {std::pair{0, 0}, {0, 90}, {45, 45}, {45, 135}, {20, 80}, {70, 10}})
    shot("p" + std::to_string(p) + "_a" + std::to_string(a), cell.intensity(p, a));
  shot("empty_parallel", 1);
  shot("empty_crossed", 0);
}
