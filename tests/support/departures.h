#pragma once
// What microscopes and cameras do to a picture's mean counts, made of the counts themselves.

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "birefit/image.h"

namespace birefit::testing {

/// The mean counts where a camera saw `from(x, y)` of them, by the straight line between four pixels.
template <class From>
void resample(Image& counts, const From& from) {
  const Image seen = counts;
  for (int y = 0; y < seen.height(); ++y)
    for (int x = 0; x < seen.width(); ++x) {
      const auto [u, v] = from(x, y);
      const double cu = std::clamp(u, 0.0, seen.width() - 1.001), cv = std::clamp(v, 0.0, seen.height() - 1.001);
      const int i = static_cast<int>(cu), j = static_cast<int>(cv);
      const double a = cu - i, b = cv - j;
      counts(x, y) = (1 - b) * ((1 - a) * seen(i, j) + a * seen(i + 1, j)) +
                     b * ((1 - a) * seen(i, j + 1) + a * seen(i + 1, j + 1));
    }
}

using Disturb = std::function<void(Image&)>;

/// About a column, narrower by a share.
inline Disturb narrowed(double center_x, double share) {
  return [=](Image& counts) {
    resample(counts, [=](int x, int y) { return std::pair(center_x + (x - center_x) * (1 + share), 1.0 * y); });
  };
}
/// The mean over three by three points so many pixels apart.
inline Disturb blurred(double pixels) {
  return [=](Image& counts) {
    Image sum(counts.width(), counts.height());
    for (const double dx : {-pixels, 0.0, pixels})
      for (const double dy : {-pixels, 0.0, pixels}) {
        Image moved = counts;
        resample(moved, [&](int x, int y) { return std::pair(x + dx, y + dy); });
        for (std::size_t i = 0; i < sum.size(); ++i) sum.values()[i] += moved.values()[i] / 9;
      }
    counts = sum;
  };
}
/// Light to a power, of the counts that are brightest.
inline Disturb bent(double brightest, double power) {
  return [=](Image& counts) {
    for (double& v : counts.values()) v = brightest * std::pow(std::max(0.0, v / brightest), power);
  };
}
/// Counts to values f(counts, x, y), x to the right and y upwards from the middle, 1 at the edges.
inline Disturb over(const std::function<double(double, double, double)>& f) {
  return [=](Image& counts) {
    const double u = 0.5 * (counts.width() - 1), v = 0.5 * (counts.height() - 1);
    for (int y = 0; y < counts.height(); ++y)
      for (int x = 0; x < counts.width(); ++x) counts(x, y) = f(counts(x, y), (x - u) / (u + 0.5), (v - y) / (v + 0.5));
  };
}

}  // namespace birefit::testing
