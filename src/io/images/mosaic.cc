#include "io/images/mosaic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace birefit {
namespace {

constexpr int kTile = 8;
constexpr std::size_t kFewestTiles = 25;
/// Alternation must keep its sign within tiles: its rms over that of its standard errors. Pictures without a mosaic,
/// fringes and noise of any kind, show 0.7 to 1.5, mosaics 3.7 to 18.
constexpr double kCoherent = 3;
/// Its rms over the mean light and over the range of the values. Readout taps that differ reach 0.02 along both sides,
/// mosaics start at 0.05.
constexpr double kOfLight = 0.04, kOfRange = 0.03;

/// Alternation along x, along y, and of the diagonals, of a tile: what its pixels hold at the highest frequencies.
struct Tile {
  std::array<double, 3> mean{}, error{};
};

std::array<double, 3> alternation(const Image& v, int x, int y) {
  const auto sum = [&](double side_x, double side_y) {  // weights (side, 2, side) along both
    double total = 0;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) total += (i ? side_x : 2) * (j ? side_y : 2) * v(x + i, y + j);
    return total / 16;
  };
  const double sign_x = x % 2 ? -1 : 1, sign_y = y % 2 ? -1 : 1;
  return {sign_x * sum(-1, 1), sign_y * sum(1, -1), sign_x * sign_y * sum(-1, -1)};
}

/// Its four quarters tell how well a tile's mean is known.
std::optional<Tile> tile_at(const Image& values, int left, int top, double smallest_step) {
  std::array<std::array<double, 4>, 3> quarters{};
  for (int y = 0; y < kTile; ++y)
    for (int x = 0; x < kTile; ++x) {
      const std::array<double, 3> here = alternation(values, left + x, top + y);
      for (std::size_t k = 0; k < 3; ++k) {
        if (!std::isfinite(here[k])) return std::nullopt;
        quarters[k][static_cast<std::size_t>(2 * (y / (kTile / 2)) + x / (kTile / 2))] += here[k] / (kTile * kTile / 4);
      }
    }
  Tile tile;
  for (std::size_t k = 0; k < 3; ++k) {
    double squares = 0;
    for (const double q : quarters[k]) tile.mean[k] += q / 4;
    for (const double q : quarters[k]) squares += (q - tile.mean[k]) * (q - tile.mean[k]) / 3;
    tile.error[k] = std::max(std::sqrt(squares / 4), 0.05 * smallest_step);
  }
  return tile;
}

double rms(const std::vector<Tile>& tiles, std::size_t k) {
  double sum = 0;
  for (const Tile& tile : tiles) sum += tile.mean[k] * tile.mean[k];
  return std::sqrt(sum / static_cast<double>(tiles.size()));
}

/// Without the tenth of the tiles that would count most, so that a few fringes as fine as pixels make no mosaic.
double coherence(std::vector<Tile> tiles, std::size_t k) {
  const auto weight = [&](const Tile& t) { return t.mean[k] * t.mean[k] + 4 * t.error[k] * t.error[k]; };
  std::sort(tiles.begin(), tiles.end(), [&](const Tile& a, const Tile& b) { return weight(a) < weight(b); });
  tiles.resize(tiles.size() - tiles.size() / 10);
  double errors = 0;
  for (const Tile& tile : tiles) errors += tile.error[k] * tile.error[k];
  return rms(tiles, k) / std::sqrt(errors / static_cast<double>(tiles.size()));
}

}  // namespace

std::optional<std::string> find_mosaic(const Image& values, const PixelRect& area, double smallest_step) {
  std::vector<Tile> tiles;
  for (int top = std::max(1, area.y0); top + kTile + 1 <= std::min(values.height(), area.y1); top += kTile)
    for (int left = std::max(1, area.x0); left + kTile + 1 <= std::min(values.width(), area.x1); left += kTile)
      if (const auto tile = tile_at(values, left, top, smallest_step)) tiles.push_back(*tile);
  if (tiles.size() < kFewestTiles) return std::nullopt;
  std::vector<double> sorted;
  double mean = 0;
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0; x < area.x1; ++x)
      if (const double value = values(x, y); std::isfinite(value)) sorted.push_back(value), mean += value;
  mean /= static_cast<double>(sorted.size());
  const auto rank = [&](double fraction) {
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(sorted.size() - 1));
    std::nth_element(sorted.begin(), at, sorted.end());
    return *at;
  };
  const double light = mean - rank(0.001), range = rank(0.99) - rank(0.01);
  std::array<double, 3> size{};
  std::array<bool, 3> there{};
  for (std::size_t k = 0; k < 3; ++k) {
    size[k] = rms(tiles, k);
    there[k] = size[k] > kOfLight * light && size[k] > kOfRange * range && coherence(tiles, k) > kCoherent;
  }
  // One side alone: two readout taps, an interlaced camera.
  if (!there[2] && !(there[0] && there[1])) return std::nullopt;
  // Two crossed pairs of analysers let through the same light together: the diagonals' sums agree. Two pixels of a
  // colour cell are green: what alternates along x and along y is the same but for its sign.
  double unlike = 0;
  for (const Tile& tile : tiles) unlike += std::pow(std::abs(tile.mean[0]) - std::abs(tile.mean[1]), 2);
  unlike = std::sqrt(unlike / static_cast<double>(tiles.size()));
  const double sides = std::hypot(size[0], size[1]);
  const bool polarization = size[2] < 0.2 * sides, colour = unlike < 0.2 * sides;
  if (polarization && !colour) return "polarization";
  if (colour && !polarization) return "colour (Bayer)";
  return "colour (Bayer) or polarization";
}

}  // namespace birefit
