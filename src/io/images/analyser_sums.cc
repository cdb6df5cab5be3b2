#include "io/images/analyser_sums.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace birefit {
namespace {

constexpr std::size_t kCells = 40000;  // looked at, at most
constexpr int kTiles = 16;             // along each side: what scatters between them is the error
constexpr std::size_t kFewest = 30;    // tiles
constexpr double kLeastSide = 0.1;
constexpr double kLeast = 0.25, kMost = 4;  // gammas

/// The pixels of a cell, a crossed pair behind the other, and the tile it lies in.
struct MosaicCell {
  std::array<double, 4> value;
  std::size_t tile;
};

/// Places (x, y) in the cell of one crossed pair, then of the other.
std::optional<std::array<std::array<int, 2>, 4>> crossed_pairs(const std::array<std::array<double, 2>, 2>& angle) {
  constexpr double kOff = 1;  // deg
  const std::array<std::array<int, 2>, 4> place{{{0, 0}, {1, 0}, {0, 1}, {1, 1}}};
  const auto between = [&](std::size_t a, std::size_t b) {
    const double d =
        std::remainder(angle[static_cast<std::size_t>(place[a][1])][static_cast<std::size_t>(place[a][0])] -
                           angle[static_cast<std::size_t>(place[b][1])][static_cast<std::size_t>(place[b][0])],
                       180);
    return std::abs(d);
  };
  for (const auto& [a, b, c] : {std::array<std::size_t, 3>{1, 2, 3}, {2, 1, 3}, {3, 1, 2}})
    if (std::abs(between(0, a) - 90) < kOff && std::abs(between(b, c) - 90) < kOff && between(0, b) > kOff &&
        between(0, b) < 90 - kOff)
      return std::array{place[0], place[a], place[b], place[c]};
  return std::nullopt;
}

/// Of values to the power of gamma: by how much the sums differ, over their mean, and by how much more the first pair
/// is polarized than the second, of fully polarized light 1. A curve between light and values makes the first a
/// multiple of the second.
struct Share {
  double sums, polarized;
};
Share share_of(const MosaicCell& cell, double gamma) {
  std::array<double, 4> light;
  for (std::size_t i = 0; i < 4; ++i) light[i] = std::pow(cell.value[i], gamma);
  const double a = light[0] + light[1], b = light[2] + light[3], mean = 0.5 * (a + b);
  const double p = (light[0] - light[1]) / mean, q = (light[2] - light[3]) / mean;
  return {(a - b) / mean, p * p - q * q};
}

/// The covariance of both shares, its parts from each tile, the mismatch where light is polarized, and how much of that
/// is along the pair that has the less of it.
struct Balance {
  double covariance = 0, mismatch = 0, lesser_side = 0;
  std::vector<double> of_tile;
};
Balance balance(const std::vector<MosaicCell>& cells, double gamma) {
  double mean = 0, weights = 0, first = 0;
  std::vector<Share> shares;
  for (const MosaicCell& cell : cells) {
    shares.push_back(share_of(cell, gamma));
    mean += shares.back().polarized / static_cast<double>(cells.size());
  }
  Balance all;
  all.of_tile.assign(std::size_t{kTiles} * kTiles, 0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const double part = shares[i].sums * (shares[i].polarized - mean);
    all.covariance += part;
    all.of_tile[cells[i].tile] += part;
    all.mismatch += shares[i].sums * shares[i].polarized;
    weights += std::abs(shares[i].polarized);
    first += std::max(shares[i].polarized, 0.0);
  }
  if (weights > 0) {
    all.mismatch = std::abs(all.mismatch) / weights;
    all.lesser_side = std::min(first, weights - first) / weights;
  }
  return all;
}

std::vector<MosaicCell> cells_of(const Image& values, const Mask& usable, const PixelRect& area,
                                 const std::array<std::array<int, 2>, 4>& pairs) {
  const int x0 = std::max(area.x0, 0) / 2, y0 = std::max(area.y0, 0) / 2, x1 = std::min(area.x1, values.width()) / 2,
            y1 = std::min(area.y1, values.height()) / 2, width = x1 - x0, height = y1 - y0;
  std::vector<MosaicCell> cells;
  if (width < kTiles || height < kTiles) return cells;
  int step = 1;
  while (static_cast<std::size_t>(width / step) * static_cast<std::size_t>(height / step) > kCells) ++step;
  for (int y = y0; y < y1; y += step)
    for (int x = x0; x < x1; x += step) {
      MosaicCell cell{};
      bool good = true;
      for (std::size_t i = 0; i < 4; ++i) {
        const int column = 2 * x + pairs[i][0], row = 2 * y + pairs[i][1];
        cell.value[i] = values(column, row);
        good = good && usable(column, row) && std::isfinite(cell.value[i]) && cell.value[i] > 0;
      }
      cell.tile = static_cast<std::size_t>((y - y0) * kTiles / height * kTiles + (x - x0) * kTiles / width);
      if (good) cells.push_back(cell);
    }
  return cells;
}

}  // namespace

std::optional<AnalyserSums> analyser_sums(const Image& values, const Mask& usable, const PixelRect& area,
                                          const std::array<std::array<double, 2>, 2>& analyser_deg) {
  const auto pairs = crossed_pairs(analyser_deg);
  if (!pairs) return std::nullopt;
  const std::vector<MosaicCell> cells = cells_of(values, usable, area, *pairs);
  std::vector<std::size_t> tiles;
  for (const MosaicCell& cell : cells) tiles.push_back(cell.tile);
  std::sort(tiles.begin(), tiles.end());
  tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
  if (tiles.size() < kFewest) return std::nullopt;
  // Of a gamma that is too small the sum of the pair that is more polarized is the smaller one.
  double low = kLeast, high = kMost;
  if (!(balance(cells, low).covariance < 0) || !(balance(cells, high).covariance > 0)) return std::nullopt;
  for (int i = 0; i < 24; ++i) {
    const double middle = std::sqrt(low * high);
    (balance(cells, middle).covariance < 0 ? low : high) = middle;
  }
  AnalyserSums found;
  found.gamma = std::sqrt(low * high);
  found.mismatch = balance(cells, 1).mismatch;
  constexpr double kStep = 0.02;
  const Balance above = balance(cells, found.gamma * (1 + kStep)), below = balance(cells, found.gamma * (1 - kStep));
  const double slope = (above.covariance - below.covariance) / (2 * kStep * found.gamma);
  const Balance at_it = balance(cells, found.gamma);
  double squares = 0;
  for (const double part : at_it.of_tile) squares += part * part;
  found.error = std::sqrt(squares) / slope;
  // Along one pair alone, purer and less pure light tells nothing that sensitivities would not.
  if (at_it.lesser_side < kLeastSide || !(slope > 0) || !(found.error < found.gamma)) return std::nullopt;
  return found;
}

}  // namespace birefit
