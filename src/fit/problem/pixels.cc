#include "fit/problem/pixels.h"

#include <algorithm>
#include <cmath>

namespace birefit::estimation {

Pixels usable_pixels(const Picture& micrograph, const Image& sigma) {
  Pixels pixels;
  for (int y = 0; y < micrograph.values.height(); ++y)
    for (int x = 0; x < micrograph.values.width(); ++x)
      if (micrograph.mask(x, y) && std::isfinite(micrograph.values(x, y)) && std::isfinite(sigma(x, y)) &&
          sigma(x, y) > 0)
        pixels.push_back({x, y});
  return pixels;
}

PixelSet pixel_set(const Picture& micrograph, const Image& sigma, Pixels pixels) {
  PixelSet set;
  set.pixels = std::move(pixels);
  const auto n = static_cast<Eigen::Index>(set.pixels.size());
  set.value.resize(n);
  set.sigma.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto [x, y] = set.pixels[static_cast<std::size_t>(i)];
    set.value[i] = micrograph.values(x, y);
    set.sigma[i] = sigma(x, y);
  }
  return set;
}

Pixels subsample(const Pixels& pixels, std::size_t wanted) {
  if (pixels.size() <= wanted) return pixels;
  constexpr double kGolden = 0.6180339887498949;
  std::vector<std::size_t> chosen(wanted);
  for (std::size_t i = 0; i < wanted; ++i) {
    const double turn = kGolden * static_cast<double>(i + 1);
    chosen[i] = std::min(pixels.size() - 1,
                         static_cast<std::size_t>((turn - std::floor(turn)) * static_cast<double>(pixels.size())));
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  Pixels part;
  for (const std::size_t i : chosen) part.push_back(pixels[i]);
  return part;
}

}  // namespace birefit::estimation
