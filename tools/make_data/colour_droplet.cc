// Makes the photograph of data/colour_droplet: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/colour_droplet.cc -o make_colour && ./make_colour
// writes photograph.ppm, which any image tool turns into the shipped PNG.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "independent_droplet.h"

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 96, kRadii = 6000, kSub = 6;
  constexpr double kPlanck = 2850, kBirefringence = 0.165, kResonanceNm = 225, kSodiumNm = 589.3;
  // wavelength_nm and r, g, b every 5 nm
  std::ifstream table("tests/data/instrument/camera/nikon_d5100.csv");
  std::string line;
  std::getline(table, line);
  std::vector<std::array<double, 4>> camera;
  while (std::getline(table, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream cells(line);
    std::array<double, 4> row{};
    for (double& x : row) cells >> x;
    camera.push_back(row);
  }
  // The light of every colour at radii, by the trapezium rule over half steps of the table.
  IndependentDroplet drop;
  drop.diameter_um = 10.6, drop.n_o = 1.52, drop.n_host = 1.5;
  const double step_um = drop.edge_um() / kRadii;
  std::array<std::vector<double>, 3> ring;
  std::array<double, 3> white{};
  for (auto& colour : ring) colour.assign(kRadii + 2, 0.0);
  for (std::size_t i = 0; i + 1 < 2 * camera.size(); ++i) {
    const std::size_t k = i / 2;
    const bool between = i % 2 != 0;
    if (between && k + 1 == camera.size()) break;
    const auto cell = [&](std::size_t c) { return between ? 0.5 * (camera[k][c] + camera[k + 1][c]) : camera[k][c]; };
    const double nm = cell(0), um = 1e-3 * nm;
    const double lamp = std::pow(um, -5) / std::expm1(14387.76877 / (um * kPlanck));
    const double w2 = nm * nm, s2 = kSodiumNm * kSodiumNm, r2 = kResonanceNm * kResonanceNm;
    drop.wavelength_um = um;
    drop.n_e = drop.n_o + kBirefringence * w2 * (s2 - r2) / (s2 * (w2 - r2));
    for (std::size_t c = 0; c < 3; ++c) white[c] += lamp * cell(c + 1);
    for (int j = 1; j <= kRadii + 1; ++j) {
      const double light = lamp * drop.ring(j * step_um);
      for (std::size_t c = 0; c < 3; ++c) ring[c][static_cast<std::size_t>(j)] += light * cell(c + 1);
    }
  }
  for (std::size_t c = 0; c < 3; ++c)
    for (double& x : ring[c]) x /= white[c];
  // Exposure and white balance, a little stray light, noise, 8 bit of sRGB.
  const std::array<double, 3> gain{0.78, 0.92, 0.71}, offset{0.011, 0.009, 0.014};
  const double center_x = 47.3, center_y = 48.6, pixel_um = 0.16;
  std::mt19937_64 random(405);
  std::normal_distribution<double> noise(0, 1);
  std::FILE* file = std::fopen("photograph.ppm", "wb");
  if (!file) return 1;
  std::fprintf(file, "P6\n%d %d\n255\n", kSize, kSize);
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      std::array<double, 3> mean{};
      for (int b = 0; b < kSub; ++b)
        for (int a = 0; a < kSub; ++a) {
          const double x = (column - 0.5 + (a + 0.5) / kSub - center_x) * pixel_um,
                       y = (center_y - (row - 0.5 + (b + 0.5) / kSub)) * pixel_um, rho = std::hypot(x, y) / step_um;
          if (rho >= kRadii) continue;
          const double turned = std::pow(std::sin(2 * std::atan2(y, x)), 2), part = rho - std::floor(rho);
          const std::size_t j = static_cast<std::size_t>(rho);
          for (std::size_t c = 0; c < 3; ++c)
            mean[c] += turned * ((1 - part) * ring[c][j] + part * ring[c][j + 1]) / (kSub * kSub);
        }
      for (std::size_t c = 0; c < 3; ++c) {
        const double clean = gain[c] * mean[c] + offset[c],
                     light = clean + std::sqrt(2e-6 + 4e-5 * clean) * noise(random);
        const double code = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
        std::fputc(static_cast<int>(std::lround(255 * std::clamp(code, 0.0, 1.0))), file);
      }
    }
  std::fclose(file);
}
