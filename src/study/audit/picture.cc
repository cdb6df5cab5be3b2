#include "study/audit/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/robust.h"

namespace birefit::study {
namespace {

double inside(const Image& image, int x, int y) {
  return image(std::clamp(x, 0, image.width() - 1), std::clamp(y, 0, image.height() - 1));
}

/// Keys' cubic: exact for parabolas.
double cubic(const Image& image, double x, double y) {
  const auto weights = [](double t) {
    return std::array<double, 4>{-0.5 * t + t * t - 0.5 * t * t * t, 1 - 2.5 * t * t + 1.5 * t * t * t,
                                 0.5 * t + 2 * t * t - 1.5 * t * t * t, -0.5 * t * t + 0.5 * t * t * t};
  };
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const auto wx = weights(x - x0), wy = weights(y - y0);
  double sum = 0;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      sum += wx[static_cast<std::size_t>(i)] * wy[static_cast<std::size_t>(j)] * inside(image, x0 + i - 1, y0 + j - 1);
  return sum;
}

constexpr int kBlock = 8;
/// Steps of brightness, ITU T.81 table K.1.
constexpr std::array<int, kBlock* kBlock> kSteps = {
    16, 11,  10,  16, 24, 40, 51, 61, 12,  12,  14,  19,  26, 58, 60, 55,  14,  13,  16,  24, 40, 57,
    69, 56,  14,  17, 22, 29, 51, 87, 80,  62,  18,  22,  37, 56, 68, 109, 103, 77,  24,  35, 55, 64,
    81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98,  112, 100, 103, 99};

}  // namespace

Image blurred(const Image& image, double sd_px) {
  const int reach = static_cast<int>(std::ceil(4 * sd_px));
  std::vector<double> weight;
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) sum += weight.emplace_back(std::exp(-0.5 * i * i / (sd_px * sd_px)));
  const auto along = [&](const Image& from, int dx, int dy) {
    Image to(from.width(), from.height());
    for (int y = 0; y < from.height(); ++y)
      for (int x = 0; x < from.width(); ++x) {
        double mean = 0;
        for (int i = -reach; i <= reach; ++i)
          mean += weight[static_cast<std::size_t>(i + reach)] / sum * inside(from, x + i * dx, y + i * dy);
        to(x, y) = mean;
      }
    return to;
  };
  return along(along(image, 1, 0), 0, 1);
}

Image stretched(const Image& image, double by, double center_x, double center_y) {
  Image out(image.width(), image.height());
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x)
      out(x, y) = cubic(image, center_x + (x - center_x) / (1 + by), center_y + (y - center_y) * (1 + by));
  return out;
}

Image shifted(const Image& image, double by_x, double by_y, double beyond) {
  Image out(image.width(), image.height());
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) {
      const double from_x = x - by_x, from_y = y - by_y;
      const bool within = from_x >= 0 && from_y >= 0 && from_x <= image.width() - 1 && from_y <= image.height() - 1;
      out(x, y) = within ? cubic(image, from_x, from_y) : beyond;
    }
  return out;
}

Image compressed(const Image& codes, int quality) {
  const double scale = quality < 50 ? 50.0 / quality : 2 - quality / 50.0;
  std::array<std::array<double, kBlock>, kBlock> cosine;
  for (int k = 0; k < kBlock; ++k)
    for (int i = 0; i < kBlock; ++i)
      cosine[k][i] = std::sqrt((k == 0 ? 1.0 : 2.0) / kBlock) * std::cos(std::numbers::pi * k * (i + 0.5) / kBlock);
  Image out(codes.width(), codes.height());
  using Block = std::array<std::array<double, kBlock>, kBlock>;
  for (int y0 = 0; y0 < codes.height(); y0 += kBlock)
    for (int x0 = 0; x0 < codes.width(); x0 += kBlock) {
      Block block{}, of{};
      for (int l = 0; l < kBlock; ++l)
        for (int k = 0; k < kBlock; ++k) {
          for (int j = 0; j < kBlock; ++j)
            for (int i = 0; i < kBlock; ++i)
              of[l][k] += cosine[l][j] * cosine[k][i] * (inside(codes, x0 + i, y0 + j) - 128);
          const double step = std::max(1.0, std::floor(kSteps[static_cast<std::size_t>(kBlock * l + k)] * scale + 0.5));
          of[l][k] = step * std::round(of[l][k] / step);
        }
      for (int j = 0; j < kBlock; ++j)
        for (int i = 0; i < kBlock; ++i) {
          for (int l = 0; l < kBlock; ++l)
            for (int k = 0; k < kBlock; ++k) block[j][i] += cosine[l][j] * cosine[k][i] * of[l][k];
          if (x0 + i < codes.width() && y0 + j < codes.height())
            out(x0 + i, y0 + j) = std::clamp(std::round(block[j][i] + 128), 0.0, 255.0);
        }
    }
  return out;
}

Image every_fourth(const Image& image) {
  Image out(image.width(), image.height());
  const int right = (image.width() - 1) / 2 * 2, down = (image.height() - 1) / 2 * 2;
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) {
      const int x0 = std::min(x / 2 * 2, right), y0 = std::min(y / 2 * 2, down), x1 = std::min(x0 + 2 * (x % 2), right),
                y1 = std::min(y0 + 2 * (y % 2), down);
      out(x, y) = 0.25 * (image(x0, y0) + image(x1, y0) + image(x0, y1) + image(x1, y1));
    }
  return out;
}

double level_of_border(const Image& image) {
  std::vector<double> values;
  for (int x = 0; x < image.width(); ++x) values.push_back(image(x, 0)), values.push_back(image(x, image.height() - 1));
  for (int y = 0; y < image.height(); ++y) values.push_back(image(0, y)), values.push_back(image(image.width() - 1, y));
  return median(std::move(values));
}

}  // namespace birefit::study
