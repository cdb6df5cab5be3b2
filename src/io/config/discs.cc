#include "io/config/discs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/robust.h"
#include "core/sub_grid.h"
#include "io/config/pixels.h"

namespace birefit {
namespace {

constexpr int kCellsAcross = 16;  // of the least diameter
constexpr int kReach = 2;         // cells: dark rings and crosses of one object are narrower than twice that

/// The picture in cells of some pixels each: how much light there is that is neither ground nor noise.
struct Activity {
  int side = 1;  ///< pixels
  Image of_cell;
  double threshold = 0;
};

double median_of_border(const Image& values, const Mask& mask) {
  std::vector<double> border;
  for (int y = 0; y < values.height(); ++y)
    for (int x = 0; x < values.width(); ++x) {
      const bool edge = x < 2 || y < 2 || x >= values.width() - 2 || y >= values.height() - 2;
      if (edge && mask(x, y) && std::isfinite(values(x, y))) border.push_back(values(x, y));
    }
  return border.empty() ? 0 : median(std::move(border));
}

Activity activity_in(const Image& values, const Mask& mask, double least_diameter_px) {
  Activity activity;
  activity.side = std::max(1, static_cast<int>(least_diameter_px / kCellsAcross));
  const int side = activity.side, columns = values.width() / side, rows = values.height() / side;
  const double ground = median_of_border(values, mask);
  const double noise = noise_of_neighbours(values, {0, 0, values.width(), values.height()}).value_or(0);
  activity.of_cell = Image(columns, rows);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      double squares = 0;
      int count = 0;
      for (int y = row * side; y < (row + 1) * side; ++y)
        for (int x = column * side; x < (column + 1) * side; ++x)
          if (mask(x, y) && std::isfinite(values(x, y))) squares += std::pow(values(x, y) - ground, 2), ++count;
      if (count > 0) activity.of_cell(column, row) = std::sqrt(std::max(0.0, squares / count - noise * noise));
    }
  constexpr double kStrong = 0.98, kShare = 0.15, kOverNoise = 4;
  activity.threshold =
      std::max(kShare * quantile(activity.of_cell.values(), kStrong), kOverNoise * noise / std::sqrt(side));
  return activity;
}

struct Patch {
  int left, right, top, bottom;  ///< of its active cells
  int cells = 0;
  int extent() const { return std::max(right - left, bottom - top) + 1; }
};

/// Active cells within reach of each other are one patch; `label`: of every cell, -1 where there is none.
std::vector<Patch> patches_of(const Activity& activity, Grid<int>& label) {
  const Image& cells = activity.of_cell;
  label = Grid<int>(cells.width(), cells.height(), -1);
  std::vector<Patch> patches;
  std::vector<std::pair<int, int>> open;
  const auto is_new = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < cells.width() && y < cells.height() && label(x, y) < 0 &&
           cells(x, y) > activity.threshold;
  };
  for (int y = 0; y < cells.height(); ++y)
    for (int x = 0; x < cells.width(); ++x) {
      if (!is_new(x, y)) continue;
      const int number = static_cast<int>(patches.size());
      Patch patch{x, x, y, y};
      open.assign(1, {x, y}), label(x, y) = number;
      while (!open.empty()) {
        const auto [u, v] = open.back();
        open.pop_back();
        patch.left = std::min(patch.left, u), patch.right = std::max(patch.right, u);
        patch.top = std::min(patch.top, v), patch.bottom = std::max(patch.bottom, v), ++patch.cells;
        for (int dy = -2 * kReach; dy <= 2 * kReach; ++dy)
          for (int dx = -2 * kReach; dx <= 2 * kReach; ++dx)
            if (dx * dx + dy * dy <= 4 * kReach * kReach && is_new(u + dx, v + dy))
              label(u + dx, v + dy) = number, open.push_back({u + dx, v + dy});
      }
      patches.push_back(patch);
    }
  return patches;
}

/// The object in a patch, the others' cells not seen.
DiscGuess disc_in(const Image& values, const Mask& mask, const Activity& activity, const Grid<int>& label,
                  const Patch& patch, int number) {
  const int margin = std::max(2 * kReach, patch.extent() / 4), side = activity.side;
  const PixelRect part{std::max(0, (patch.left - margin) * side), std::max(0, (patch.top - margin) * side),
                       std::min(values.width(), (patch.right + 1 + margin) * side),
                       std::min(values.height(), (patch.bottom + 1 + margin) * side)};
  Image crop(part.width(), part.height());
  Mask used(part.width(), part.height(), 0);
  for (int y = part.y0; y < part.y1; ++y)
    for (int x = part.x0; x < part.x1; ++x) {
      const int column = std::min(x / side, label.width() - 1), row = std::min(y / side, label.height() - 1);
      const int whose = label(column, row);
      crop(x - part.x0, y - part.y0) = values(x, y);
      used(x - part.x0, y - part.y0) = mask(x, y) && (whose < 0 || whose == number);
    }
  DiscGuess disc = find_disc(crop, used);
  disc.center_x_px += part.x0, disc.center_y_px += part.y0;
  return disc;
}

struct Object {
  Patch patch;
  int number;  ///< its cells' label
  DiscGuess disc;
};

/// Lobes of one object lie further apart than cells reach where another one is brighter, so that what is dark between
/// them is wider: two objects are one where the discs around them next to touch, or overlap, and a disc around both
/// holds their centres, is of a size within the bounds and nearer to what is looked for than either of them.
void join_lobes(const Image& values, const Mask& mask, const Activity& activity, const DiameterPx& diameter,
                Grid<int>& label, std::vector<Object>& objects) {
  const auto away = [&](const DiscGuess& disc) {
    return std::abs(std::log(std::max(2 * disc.radius_px, 1.0) / diameter.start));
  };
  const auto touch = [](const DiscGuess& a, const DiscGuess& b) {
    constexpr double kTouch = 1.15;
    return std::hypot(a.center_x_px - b.center_x_px, a.center_y_px - b.center_y_px) <
           kTouch * (a.radius_px + b.radius_px);
  };
  const auto join = [&](Object& a, const Object& b) {
    if (!touch(a.disc, b.disc)) return false;
    Object both{a.patch, a.number, {}};
    both.patch.left = std::min(a.patch.left, b.patch.left), both.patch.right = std::max(a.patch.right, b.patch.right);
    both.patch.top = std::min(a.patch.top, b.patch.top), both.patch.bottom = std::max(a.patch.bottom, b.patch.bottom);
    both.patch.cells += b.patch.cells;
    if (both.patch.extent() * activity.side > diameter.most) return false;
    Grid<int> joined = label;
    for (int& number : joined.values())
      if (number == b.number) number = a.number;
    both.disc = disc_in(values, mask, activity, joined, both.patch, both.number);
    const auto holds = [&](const DiscGuess& disc) {
      return std::hypot(disc.center_x_px - both.disc.center_x_px, disc.center_y_px - both.disc.center_y_px) <
             both.disc.radius_px;
    };
    if (!diameter.holds(both.disc) || !holds(a.disc) || !holds(b.disc) ||
        away(both.disc) >= std::min(away(a.disc), away(b.disc)))
      return false;
    label = std::move(joined), a = both;
    return true;
  };
  for (std::size_t i = 0; i < objects.size(); ++i)
    for (std::size_t j = i + 1; j < objects.size();)
      if (join(objects[i], objects[j]))
        objects.erase(objects.begin() + static_cast<std::ptrdiff_t>(j)), j = i + 1;
      else
        ++j;
}

}  // namespace

DiameterPx diameter_px(const Parameter& diameter_um, double pixel_um) {
  constexpr double kTolerance = 1.15;
  const double start = diameter_um.value / pixel_um;
  const auto bound = [&](double stated, double otherwise) {
    return (!diameter_um.free ? start : std::isfinite(stated) ? stated / pixel_um : otherwise * start);
  };
  return {start, bound(diameter_um.lower, 0.8) / kTolerance, bound(diameter_um.upper, 1.25) * kTolerance};
}

std::vector<DiscGuess> find_discs(const Image& values, const Mask& mask, const DiameterPx& diameter) {
  if (const SubGrid grid = sub_grid(mask); grid.spacing > 1) {  // one colour of a mosaic
    const double s = grid.spacing;
    auto discs = find_discs(on_grid(values, grid), on_grid(mask, grid),
                            {diameter.start / s, diameter.least / s, diameter.most / s});
    for (DiscGuess& disc : discs)
      disc.center_x_px = grid.x0 + s * disc.center_x_px, disc.center_y_px = grid.y0 + s * disc.center_y_px,
      disc.radius_px *= s;
    return discs;
  }
  constexpr double kSmaller = 0.8;
  const double least_diameter_px = kSmaller * diameter.start;
  if (!(least_diameter_px >= 3) || values.empty() || mask.size() != values.size()) return {};
  const Activity activity = activity_in(values, mask, least_diameter_px);
  Grid<int> label;
  const std::vector<Patch> patches = patches_of(activity, label);
  // Half as large, and not a line: a scratch, the edge of something else.
  const auto is_object = [](const Patch& patch) {
    constexpr double kFilled = 0.2;
    const int width = patch.right - patch.left + 1, height = patch.bottom - patch.top + 1;
    return 2 * patch.extent() >= kCellsAcross && 2 * std::min(width, height) >= patch.extent() &&
           patch.cells > kFilled * width * height;
  };
  if (std::count_if(patches.begin(), patches.end(), is_object) < 2) return {};
  std::vector<Object> objects;
  for (std::size_t i = 0; i < patches.size(); ++i)
    if (const int number = static_cast<int>(i); is_object(patches[i]))
      objects.push_back({patches[i], number, disc_in(values, mask, activity, label, patches[i], number)});
  join_lobes(values, mask, activity, diameter, label, objects);
  constexpr double kLeastContrast = 3;  // as of a single one
  std::vector<DiscGuess> discs;
  for (const Object& object : objects)
    if (object.disc.contrast >= kLeastContrast) discs.push_back(object.disc);
  std::sort(discs.begin(), discs.end(),
            [](const DiscGuess& a, const DiscGuess& b) { return a.radius_px > b.radius_px; });
  if (discs.size() < 2) return {};
  // Rings and lobes of one object lie apart, too: all around them is of a size within the bounds, and none of them is
  // as large as what is looked for, or opposite of each there is another.
  const DiscGuess whole = find_disc(values, mask);
  if (!diameter.holds(whole)) return discs;
  const auto as_large = [&](const DiscGuess& disc) {
    return 2 * disc.radius_px > 0.7 * diameter.start && 2 * disc.radius_px < 1.4 * diameter.start;
  };
  const auto has_opposite = [&](const DiscGuess& disc) {
    return std::any_of(discs.begin(), discs.end(), [&](const DiscGuess& other) {
      constexpr double kNear = 0.15;
      return std::hypot(disc.center_x_px + other.center_x_px - 2 * whole.center_x_px,
                        disc.center_y_px + other.center_y_px - 2 * whole.center_y_px) < kNear * whole.radius_px;
    });
  };
  if (std::none_of(discs.begin(), discs.end(), as_large) || std::all_of(discs.begin(), discs.end(), has_opposite))
    return {};
  return discs;
}

}  // namespace birefit
