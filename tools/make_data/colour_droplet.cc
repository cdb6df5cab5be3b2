// Makes the photograph of data/colour_droplet: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/colour_droplet.cc -o make_colour && ./make_colour
// writes photograph.ppm, which any image tool turns into the shipped PNG.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "independent_colour.h"

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 96;
  IndependentColourDroplet seen;
  seen.birefringence = 0.165, seen.resonance_nm = 225, seen.planck_k = 2850, seen.radii = 6000;
  IndependentDroplet& droplet = seen.droplet;
  droplet.diameter_um = 10.6, droplet.n_o = 1.52, droplet.n_host = 1.5;
  droplet.center_x_px = 47.3, droplet.center_y_px = 48.6, droplet.pixel_um = 0.16;
  const auto light = seen.pictures(camera_rows("tests/data/instrument/camera/nikon_d5100.csv"), kSize);
  // Exposure and white balance, a little stray light, noise, 8 bit of sRGB.
  const double gain[] = {0.78, 0.92, 0.71}, offset[] = {0.011, 0.009, 0.014};
  std::mt19937_64 random(405);
  std::normal_distribution<double> noise(0, 1);
  std::FILE* file = std::fopen("photograph.ppm", "wb");
  if (!file) return 1;
  std::fprintf(file, "P6\n%d %d\n255\n", kSize, kSize);
  for (std::size_t i = 0; i < light[0].size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      const double clean = gain[c] * light[c][i] + offset[c],
                   recorded = clean + std::sqrt(2e-6 + 4e-5 * clean) * noise(random);
      const double code = recorded <= 0.0031308 ? 12.92 * recorded : 1.055 * std::pow(recorded, 1 / 2.4) - 0.055;
      std::fputc(static_cast<int>(std::lround(255 * std::clamp(code, 0.0, 1.0))), file);
    }
  std::fclose(file);
}
