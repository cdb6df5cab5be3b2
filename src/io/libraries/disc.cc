// The one round object of a crossed- (or parallel-) polarizer image: where, how large, how clear.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "birefit/io.h"
#include "core/robust.h"
#include "core/sub_grid.h"

namespace birefit {
namespace {

constexpr int kWorkingSide = 512;  // larger images are box-averaged: a centre to 1/10 of a working pixel is plenty

struct Field {
  cv::Mat1d value;
  cv::Mat1b used;
};

/// Box average over factor x factor pixels, usable ones only.
Field shrink(const Image& values, const Mask& mask, int factor) {
  const int width = values.width() / factor, height = values.height() / factor;
  Field field{cv::Mat1d(height, width, 0.0), cv::Mat1b(height, width, std::uint8_t{0})};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      int count = 0;
      for (int v = y * factor; v < (y + 1) * factor; ++v)
        for (int u = x * factor; u < (x + 1) * factor; ++u) {
          const bool usable = mask.empty() || mask(u, v);
          if (usable && std::isfinite(values(u, v))) sum += values(u, v), ++count;
        }
      if (count == 0) continue;
      field.value(y, x) = sum / count;
      field.used(y, x) = 1;
    }
  return field;
}

/// Standard deviation of the pixel noise from second differences along rows, which smooth structure survives only in
/// part: the median ignores the rings as long as they do not fill the image.
double noise_sd(const Field& field) {
  std::vector<double> differences;
  for (int y = 0; y < field.value.rows; ++y)
    for (int x = 1; x + 1 < field.value.cols; ++x)
      if (field.used(y, x - 1) && field.used(y, x) && field.used(y, x + 1))
        differences.push_back(std::abs(field.value(y, x) - 0.5 * (field.value(y, x - 1) + field.value(y, x + 1))));
  return kNormalSdPerMad * median(std::move(differences)) / std::sqrt(1.5);
}

/// A plane through the background, refitted a few times to the pixels near it; it starts from the image's border, where
/// a droplet that is cropped covers the smaller part.
std::array<double, 3> background_plane(const Field& field, double noise) {
  const int width = field.value.cols, height = field.value.rows;
  const int border = std::max(2, std::min(width, height) / 12);
  std::vector<double> rim;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (field.used(y, x) && (x < border || y < border || x >= width - border || y >= height - border))
        rim.push_back(field.value(y, x));
  std::array<double, 3> plane = {median(rim), 0, 0};  // value, slope per half width, slope per half height
  std::vector<double> deviations;
  for (const double value : rim) deviations.push_back(std::abs(value - plane[0]));
  double tolerance = std::max(3 * kNormalSdPerMad * median(std::move(deviations)), 3 * noise);
  const auto at = [&](double x, double y) {
    return plane[0] + plane[1] * (2 * x / width - 1) + plane[2] * (2 * y / height - 1);
  };
  for (int round = 0; round < 8; ++round) {
    cv::Matx33d normal = cv::Matx33d::zeros();
    cv::Vec3d right(0, 0, 0);
    std::vector<double> residuals;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (!field.used(y, x)) continue;
        // The rim decides first; then whatever agrees with its plane, rim or not.
        const bool in_rim = x < border || y < border || x >= width - border || y >= height - border;
        if (round < 3 && !in_rim) continue;
        const double residual = field.value(y, x) - at(x, y);
        if (std::abs(residual) > tolerance) continue;
        const cv::Vec3d basis(1, 2.0 * x / width - 1, 2.0 * y / height - 1);
        normal += basis * basis.t();
        right += basis * field.value(y, x);
        residuals.push_back(std::abs(residual));
      }
    if (residuals.size() < 16) break;
    const double ridge = 1e-9 * normal(0, 0);
    for (int i = 0; i < 3; ++i) normal(i, i) += ridge;
    const cv::Vec3d solution = normal.solve(right, cv::DECOMP_CHOLESKY);
    plane = {solution[0], solution[1], solution[2]};
    tolerance = std::max(3 * kNormalSdPerMad * median(std::move(residuals)), 3 * noise);
  }
  return plane;
}

struct Circle {
  double x = 0, y = 0, radius = 0;
};

/// Least-squares circle (Kasa), refitted without the points far from it: the dark cross dents an outline.
Circle fit_circle(std::vector<cv::Point2d> points, Circle start) {
  Circle circle = start;
  for (int round = 0; round < 6 && points.size() >= 8; ++round) {
    cv::Matx33d normal = cv::Matx33d::zeros();
    cv::Vec3d right(0, 0, 0);
    for (const cv::Point2d& p : points) {
      const cv::Vec3d basis(p.x - start.x, p.y - start.y, 1);
      normal += basis * basis.t();
      right += basis * (basis[0] * basis[0] + basis[1] * basis[1]);
    }
    if (std::abs(cv::determinant(normal)) < 1e-9) break;
    const cv::Vec3d solution = normal.solve(right, cv::DECOMP_LU);
    const double squared = solution[2] + 0.25 * (solution[0] * solution[0] + solution[1] * solution[1]);
    if (!(squared > 0)) break;
    circle = {start.x + solution[0] / 2, start.y + solution[1] / 2, std::sqrt(squared)};
    std::vector<double> distances;
    for (const cv::Point2d& p : points)
      distances.push_back(std::abs(std::hypot(p.x - circle.x, p.y - circle.y) - circle.radius));
    const double limit = std::max(1.0, 2.5 * kNormalSdPerMad * median(distances));
    std::vector<cv::Point2d> kept;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (distances[i] <= limit) kept.push_back(points[i]);
    if (kept.size() == points.size() || kept.size() < 8) break;
    points = std::move(kept);
  }
  return circle;
}

/// Correlation of the signal with itself turned by 180 degrees about (x, y), over the disc; (x, y) in half pixels lands
/// on the grid, so nothing is interpolated. Radially symmetric droplets between crossed polarizers have that symmetry.
/// Of every `stride` rows and columns one is looked at.
double inversion_correlation(const cv::Mat1d& signal, const cv::Mat1b& used, int twice_x, int twice_y, double radius,
                             int stride) {
  const double cx = 0.5 * twice_x, cy = 0.5 * twice_y;
  const int y0 = std::max({0, static_cast<int>(std::ceil(cy - radius)), twice_y - (signal.rows - 1)});
  const int x0 = std::max({0, static_cast<int>(std::ceil(cx - radius)), twice_x - (signal.cols - 1)});
  double product = 0, square = 0, sum = 0;
  long count = 0;
  for (int y = y0; 2 * y <= twice_y; y += stride) {
    const int v = twice_y - y;
    if (v >= signal.rows || v < 0) continue;
    for (int x = x0; x <= std::min(signal.cols - 1, twice_x - x0); x += stride) {
      const int u = twice_x - x;
      if (u < 0 || u >= signal.cols) continue;
      if ((x - cx) * (x - cx) + (y - cy) * (y - cy) > radius * radius) continue;
      if (!used(y, x) || !used(v, u)) continue;
      const double a = signal(y, x), b = signal(v, u);
      product += a * b;
      square += 0.5 * (a * a + b * b);
      sum += 0.5 * (a + b);
      ++count;
    }
  }
  if (count < 16) return -1;
  const double mean = sum / count;
  const double variance = square / count - mean * mean;
  return variance > 0 ? (product / count - mean * mean) / variance : -1;
}

/// Peak of a parabola through three equidistant values, in units of their distance.
double parabola_peak(double left, double middle, double right) {
  const double curvature = left - 2 * middle + right;
  return curvature < 0 ? std::clamp(0.5 * (left - right) / curvature, -1.0, 1.0) : 0.0;
}

/// The picture less its background, and how much is going on at each pixel.
struct Activity {
  cv::Mat1d signal, smooth, activity;  ///< smooth: signal, blurred
  double noise = 0;                    ///< of activity
};

Activity activity_of(const Field& field, double noise) {
  const std::array<double, 3> plane = background_plane(field, noise);
  const int width = field.value.cols, height = field.value.rows;
  cv::Mat1d signal(height, width, 0.0), activity(height, width, 0.0), weight(height, width, 0.0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (!field.used(y, x)) continue;
      signal(y, x) =
          field.value(y, x) - plane[0] - plane[1] * (2.0 * x / width - 1) - plane[2] * (2.0 * y / height - 1);
      weight(y, x) = 1;
    }

  // Smoothed signal first, then its magnitude: noise averages out instead of adding up. Masked pixels do not count.
  const double fine = std::max(1.0, std::min(width, height) / 160.0);
  cv::Mat1d smooth, fine_weight;
  cv::GaussianBlur(signal, smooth, {}, fine, fine, cv::BORDER_REFLECT_101);
  cv::GaussianBlur(weight, fine_weight, {}, fine, fine, cv::BORDER_REFLECT_101);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      activity(y, x) = fine_weight(y, x) > 0.1 ? std::abs(smooth(y, x) / fine_weight(y, x)) : 0;
  return {signal, smooth, activity, noise / (2 * std::sqrt(CV_PI) * fine)};
}

/// The pixels of what is seen: its components of activity, which the cross may leave apart; none: empty.
cv::Mat1b seen_pixels(const Activity& of) {
  const cv::Mat1d& activity = of.activity;
  const int width = activity.cols, height = activity.rows;
  // Bright rings and noise separate at a level between: a share of the strong activity, well above the noise.
  std::vector<double> sorted(activity.begin(), activity.end());
  const auto strong_at = sorted.begin() + static_cast<std::ptrdiff_t>(0.98 * (sorted.size() - 1));
  std::nth_element(sorted.begin(), strong_at, sorted.end());
  const double strong = *strong_at;
  const double threshold = std::max(0.12 * strong, 4 * of.noise);
  cv::Mat1b active(height, width, std::uint8_t{0});
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) active(y, x) = activity(y, x) > threshold ? 255 : 0;

  // Close the dark rings and the cross, drop specks, keep the component with the most activity.
  const int gap = std::max(3, std::min(width, height) / 24) | 1;
  cv::Mat1b closed;
  cv::copyMakeBorder(active, closed, gap, gap, gap, gap, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::morphologyEx(closed, closed, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {gap, gap}));
  cv::morphologyEx(closed, closed, cv::MORPH_OPEN, cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3}));
  closed = closed(cv::Rect(gap, gap, width, height)).clone();
  cv::Mat1i labels;
  cv::Mat stats, centroids;
  const int components = cv::connectedComponentsWithStats(closed, labels, stats, centroids, 8);
  std::vector<double> total(components, 0.0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) total[labels(y, x)] += activity(y, x);
  total[0] = 0;
  const int best = static_cast<int>(std::max_element(total.begin(), total.end()) - total.begin());
  if (components < 2 || best == 0) return {};

  // Lobes that the cross leaves apart belong together: components nearly as strong within reach of the best.
  const auto circle_of = [&](int label, double& x, double& y) {
    x = centroids.at<double>(label, 0), y = centroids.at<double>(label, 1);
    return std::sqrt(stats.at<int>(label, cv::CC_STAT_AREA) / CV_PI);
  };
  double best_x = 0, best_y = 0;
  const double best_radius = circle_of(best, best_x, best_y);
  std::vector<bool> member(components, false);
  for (int label = 1; label < components; ++label) {
    double x = 0, y = 0;
    const double radius = circle_of(label, x, y);
    member[label] = label == best || (total[label] > 0.15 * total[best] &&
                                      std::hypot(x - best_x, y - best_y) < 3 * (radius + best_radius));
  }
  cv::Mat1b seen(height, width, std::uint8_t{0});
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) seen(y, x) = labels(y, x) > 0 && member[labels(y, x)];
  return seen;
}

/// A circle along the outline: for every direction the outermost pixel as seen from the middle; those on the image's
/// edge or beside masked pixels are where the picture ends, not the droplet.
Circle outline_of(const cv::Mat1b& seen, const Field& field) {
  const int width = seen.cols, height = seen.rows;
  double middle_x = 0, middle_y = 0, mass = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (seen(y, x)) middle_x += x, middle_y += y, mass += 1;
  middle_x /= mass, middle_y /= mass;
  Circle circle{middle_x, middle_y, std::sqrt(mass / CV_PI)};
  constexpr int kDirections = 240;
  for (int round = 0; round < 2; ++round) {
    std::array<double, kDirections> reach{};
    std::array<cv::Point2d, kDirections> outermost{};
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (!seen(y, x)) continue;
        const double dx = x - circle.x, dy = y - circle.y, distance = std::hypot(dx, dy);
        const int direction = static_cast<int>((std::atan2(dy, dx) / (2 * CV_PI) + 0.5) * kDirections) % kDirections;
        if (distance > reach[direction]) reach[direction] = distance, outermost[direction] = {double(x), double(y)};
      }
    std::vector<cv::Point2d> outline;
    for (int i = 0; i < kDirections; ++i) {
      const cv::Point2d& p = outermost[i];
      if (reach[i] <= 0 || p.x < 2 || p.y < 2 || p.x > width - 3 || p.y > height - 3) continue;
      bool beside_mask = false;
      for (int dy = -2; dy <= 2; ++dy)
        for (int dx = -2; dx <= 2; ++dx) beside_mask = beside_mask || !field.used(int(p.y) + dy, int(p.x) + dx);
      if (!beside_mask) outline.push_back(p);
    }
    circle = fit_circle(outline, circle);
  }
  return circle;
}

/// The centre of symmetry near the circle's: a coarse to fine search on the half-pixel grid, then a parabola. Where
/// there is no symmetry the outline knows better.
cv::Point2d centre_of_symmetry(const cv::Mat1d& smooth, const Field& field, const Circle& circle) {
  int twice_x = static_cast<int>(std::lround(2 * circle.x)), twice_y = static_cast<int>(std::lround(2 * circle.y));
  const double reach = 1.05 * circle.radius;
  const auto score = [&](int u, int v, int stride = 1) {
    return inversion_correlation(smooth, field.used, u, v, reach, stride);
  };
  const int search = std::max(4, static_cast<int>(0.25 * circle.radius) * 2);
  const int coarse = std::max(1, static_cast<int>(circle.radius / 20));
  double best_score = -2;
  const int start_x = twice_x, start_y = twice_y;
  for (int v = start_y - search; v <= start_y + search; v += coarse)
    for (int u = start_x - search; u <= start_x + search; u += coarse)
      if (const double s = score(u, v, coarse); s > best_score) best_score = s, twice_x = u, twice_y = v;
  best_score = score(twice_x, twice_y);
  for (int step = coarse; step >= 1; step /= 2)
    for (bool moved = true; moved;) {
      moved = false;
      const int here_x = twice_x, here_y = twice_y;
      for (int v = here_y - step; v <= here_y + step; v += step)
        for (int u = here_x - step; u <= here_x + step; u += step)
          if (const double s = score(u, v); s > best_score) best_score = s, twice_x = u, twice_y = v, moved = true;
    }
  double x = circle.x, y = circle.y;
  if (best_score > 0.3) {  // a real symmetry; otherwise the outline knows better
    const double middle = score(twice_x, twice_y);
    x = 0.5 * (twice_x + parabola_peak(score(twice_x - 1, twice_y), middle, score(twice_x + 1, twice_y)));
    y = 0.5 * (twice_y + parabola_peak(score(twice_x, twice_y - 1), middle, score(twice_x, twice_y + 1)));
  }
  return {x, y};
}

/// Where the mean activity about the centre falls to the level of the background for good.
double radius_about(const cv::Point2d& centre, const Circle& circle, const cv::Mat1d& signal, const Field& field,
                    double noise) {
  const double x = centre.x, y = centre.y;
  const int width = signal.cols, height = signal.rows;
  const int bins = static_cast<int>(1.6 * circle.radius) + 2;
  std::vector<double> ring(bins, 0.0), ring_count(bins, 0.0);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const int bin = static_cast<int>(std::hypot(u - x, v - y) + 0.5);
      if (bin < bins && field.used(v, u)) ring[bin] += signal(v, u) * signal(v, u), ring_count[bin] += 1;
    }
  double strongest = 0;
  for (int i = 0; i < bins; ++i) {
    ring[i] = ring_count[i] > 0 ? std::max(0.0, ring[i] / ring_count[i] - noise * noise) : 0;
    strongest = std::max(strongest, ring[i]);
  }
  int edge = static_cast<int>(circle.radius);
  const double floor = std::max(0.02 * strongest, 0.5 * noise * noise);
  for (int i = bins - 1; i > 0; --i)
    if (ring[i] > floor && ring_count[i] > 0) {
      edge = i;
      break;
    }
  const double radius = edge + 0.5;
  return std::abs(radius / circle.radius - 1) > 0.25 ? circle.radius : radius;
}

}  // namespace

DiscGuess find_disc(const Image& values, const Mask& mask) {
  if (const SubGrid grid = sub_grid(mask); grid.spacing > 1) {
    DiscGuess guess = find_disc(on_grid(values, grid), on_grid(mask, grid));
    guess.center_x_px = grid.x0 + grid.spacing * guess.center_x_px;
    guess.center_y_px = grid.y0 + grid.spacing * guess.center_y_px;
    guess.radius_px *= grid.spacing;
    return guess;
  }
  DiscGuess guess;
  guess.center_x_px = 0.5 * (values.width() - 1);
  guess.center_y_px = 0.5 * (values.height() - 1);
  guess.radius_px = 0.25 * std::min(values.width(), values.height());
  const int factor = std::max(1, std::max(values.width(), values.height()) / kWorkingSide);
  if (values.width() / factor < 12 || values.height() / factor < 12) return guess;

  Field field = shrink(values, mask, factor);
  if (cv::countNonZero(field.used) < 64) return guess;
  double noise = noise_sd(field);
  double low = 0, high = 0;
  cv::minMaxLoc(field.value, &low, &high, nullptr, nullptr, field.used);
  if (!(high > low)) return guess;
  noise = std::max(noise, 1e-6 * (high - low));

  const Activity of = activity_of(field, noise);
  const cv::Mat1b seen = seen_pixels(of);
  if (seen.empty()) return guess;
  const Circle circle = outline_of(seen, field);
  const int width = field.value.cols, height = field.value.rows;
  if (!(circle.radius > 2) || circle.radius > 2 * std::max(width, height)) return guess;
  const cv::Point2d centre = centre_of_symmetry(of.smooth, field, circle);
  const double radius = radius_about(centre, circle, of.signal, field, noise);

  // Smoothed over the working resolution: a disc far weaker than one pixel's noise is still plain to see.
  double inside = 0, inside_count = 0;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (field.used(v, u) && std::hypot(u - centre.x, v - centre.y) <= radius)
        inside += of.activity(v, u), inside_count += 1;
  guess.center_x_px = (centre.x + 0.5) * factor - 0.5;
  guess.center_y_px = (centre.y + 0.5) * factor - 0.5;
  guess.radius_px = radius * factor;
  guess.contrast = inside_count > 0 ? inside / inside_count / of.noise : 0;
  return guess;
}

}  // namespace birefit
