// Makes the image of data/axial_droplet: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/axial_droplet.cc -o make_axial && ./make_axial
//   oiiotool --nosoftwareattrib axial_droplet.pgm -o axial_droplet.png
// The equilibrium of a hedgehog in a field along its axis, by finite differences and successive over-relaxation on a
// grid of radius and polar angle: theta_rr + 2/r theta_r + (theta_vv + cot v theta_v)/r^2 = sin theta cos theta (1/(r
// sin v)^2 + e^2).

#include "independent_droplet.h"
#include "pgm.h"

namespace {

constexpr int kCells = 300;

std::vector<double> hedgehog(double e) {
  const double h = 1.0 / kCells, k = M_PI / 2 / kCells;
  const auto at = [](int i, int j) { return static_cast<std::size_t>(i * (kCells + 1) + j); };
  std::vector<double> theta((kCells + 1) * (kCells + 1));
  for (int i = 0; i <= kCells; ++i)
    for (int j = 0; j <= kCells; ++j) theta[at(i, j)] = j * k;  // also the boundary values, on all four sides
  for (int sweep = 0; sweep < 20000; ++sweep) {
    double change = 0;
    for (int i = 1; i < kCells; ++i)
      for (int j = 1; j < kCells; ++j) {
        const double r = i * h, v = j * k, well = 1 / std::pow(r * std::sin(v), 2) + e * e;
        double& t = theta[at(i, j)];
        const double up = theta[at(i + 1, j)], down = theta[at(i - 1, j)], left = theta[at(i, j - 1)],
                     right = theta[at(i, j + 1)];
        const double rest = (up - 2 * t + down) / (h * h) + (up - down) / (h * r) +
                            ((right - 2 * t + left) / (k * k) + (right - left) / (2 * k * std::tan(v))) / (r * r) -
                            0.5 * std::sin(2 * t) * well;
        const double slope = -2 / (h * h) - 2 / (k * k * r * r) - std::cos(2 * t) * well;
        const double step = -1.9 * rest / slope;
        t += step;
        change = std::max(change, std::abs(step));
      }
    if (change < 1e-11) break;
  }
  return theta;
}

}  // namespace

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 128;
  const std::vector<double> theta = hedgehog(10);
  IndependentDroplet drop;
  drop.pixel_um = 0.08;
  drop.center_x_px = 64.4;
  drop.center_y_px = 62.7;
  drop.angle_from_axis = [&](double rho, double z) {
    const double x = std::min(1.0, std::hypot(rho, z)) * kCells, y = std::atan2(rho, z) / (M_PI / 2) * kCells;
    const int i = std::min(kCells - 1, static_cast<int>(x)), j = std::min(kCells - 1, static_cast<int>(y));
    const double a = x - i, b = y - j;
    const auto at = [&](int m, int n) { return theta[static_cast<std::size_t>(m * (kCells + 1) + n)]; };
    return (1 - a) * ((1 - b) * at(i, j) + b * at(i, j + 1)) + a * ((1 - b) * at(i + 1, j) + b * at(i + 1, j + 1));
  };
  // The ring function of the radius once, finely, instead of at every subpixel.
  constexpr int kRadii = 6000;
  std::vector<double> ring(kRadii + 2);
  const double reach = 0.65 * drop.diameter_um;  // rim rays leave a lens as if from outside it
  for (int i = 0; i <= kRadii; ++i) ring[static_cast<std::size_t>(i)] = drop.ring(reach * i / kRadii);
  std::vector<double> mean;
  constexpr int kSub = 8;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      double sum = 0;
      for (int s = 0; s < kSub * kSub; ++s) {
        const double x = (column - 0.5 + (s % kSub + 0.5) / kSub - drop.center_x_px) * drop.pixel_um;
        const double y = (drop.center_y_px - (row - 0.5 + (s / kSub + 0.5) / kSub)) * drop.pixel_um;
        const double place = std::hypot(x, y) / reach * kRadii;
        if (place >= kRadii) continue;
        const std::size_t i = static_cast<std::size_t>(place);
        sum += (ring[i] + (place - static_cast<double>(i)) * (ring[i + 1] - ring[i])) *
               std::pow(std::sin(2 * std::atan2(y, x)), 2);
      }
      mean.push_back(120 + 3500 * sum / (kSub * kSub));
    }
  write_pgm("axial_droplet.pgm", kSize, kSize, camera(mean, 0.5, 4.0, 1009));
}
