#include "fit/errors/patterns.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "samples/kind.h"
#include "scene/values.h"

namespace birefit::estimation {
namespace {

constexpr double kPi = std::numbers::pi;
/// Groups, in the order in which at() lists their patterns; what stands between is about what is round. Rows have a few
/// of these, and their law.
enum Group { kSlow, kFast, kMultiplied, kNonlinear, kRings, kShape = kRings + 4, kBlur, kLaw = kShape };
static_assert(kBlur + 1 == Patterns::kGroups);
constexpr int kDiscRings = 8, kOrders = 6;

KnownLight light_of(const Task& task, const LeastSquares& problem, int picture) {
  const auto [low, high] = problem.intensity_range(picture);
  Eigen::Index begin = 0;
  for (int g = 0; g < picture; ++g) begin += problem.pixels(g).value.size();
  const Eigen::VectorXd light = problem.intensity().segment(begin, problem.pixels(picture).value.size());
  return {task.picture(picture).scene.view, problem.theta(), problem.pixels(picture).pixels,
          (light.array() - low).matrix() / std::max(high - low, 1e-300)};
}

PixelRect around(const std::vector<std::array<int, 2>>& pixels) {
  PixelRect box{pixels.front()[0], pixels.front()[1], pixels.front()[0] + 1, pixels.front()[1] + 1};
  for (const auto& [x, y] : pixels) {
    box.x0 = std::min(box.x0, x), box.x1 = std::max(box.x1, x + 1);
    box.y0 = std::min(box.y0, y), box.y1 = std::max(box.y1, y + 1);
  }
  return box;
}

}  // namespace

Patterns::Patterns(const Task& task, const LeastSquares& problem, int picture)
    : pixels_(problem.pixels(picture).pixels), used_(around(pixels_)), light_(light_of(task, problem, picture)) {
  const Scene& scene = task.picture(picture).scene;
  const Traits traits = traits_of(scene);
  sphere_ = static_cast<bool>(traits.sphere_diameter_um);
  if (traits.round) {
    const Values<double> value(problem.theta(), {});
    radius_px_ = 0.5 * value(traits.round->diameter_um) / value(scene.view.pixel_size_um);
    from_ = traits.round->from_deg ? value.radians(traits.round->from_deg) : kPi / 2;
  }
  const int longer_side = std::max(used_.width(), used_.height());
  cosine_.resize(kOrders + 1, longer_side);
  for (int order = 0; order <= kOrders; ++order)
    for (int i = 0; i < longer_side; ++i) cosine_(order, i) = std::cos(kPi * order * (i + 0.5) / longer_side);
  add_group(kSlow, 5), add_group(kFast, 22), add_group(kMultiplied, 9), add_group(kNonlinear, 2);
  if (sphere_)
    add_group(kRings, 6), add_group(kRings + 1, 8), add_group(kRings + 2, 10), add_group(kRings + 3, 18);
  else if (radius_px_)
    for (int ring = 0; ring < 4; ++ring) add_group(kRings + ring, kDiscRings);
  if (radius_px_) add_group(kShape, 3);
  add_group(kBlur, 1);
}

void Patterns::add_group(int group, int patterns) {
  group_.insert(group_.end(), static_cast<std::size_t>(patterns), group);
}

Patterns::Polar Patterns::polar_at(int x, int y) const {
  const double dx = x - light_.center_x, dy = light_.center_y - y;
  return {std::hypot(dx, dy) / *radius_px_, std::atan2(dy, dx) - from_};
}

void Patterns::at(Eigen::Index pixel, Eigen::Ref<Eigen::VectorXd> out) const {
  const int x = pixels_[static_cast<std::size_t>(pixel)][0], y = pixels_[static_cast<std::size_t>(pixel)][1];
  const double light = light_.light(x, y);
  int k = 0;
  const auto waves = [&](int from, int to, double factor) {
    for (int order = from; order <= to; ++order)
      for (int i = 0; i <= order; ++i) out[k++] = factor * cosine_(i, x - used_.x0) * cosine_(order - i, y - used_.y0);
  };
  waves(1, 2, 1), waves(3, 6, 1);                              // light that is added, slow and faster
  waves(1, 3, light);                                          // that light is multiplied by
  out[k++] = light * light, out[k++] = light * light * light;  // a camera that is not linear
  if (radius_px_) {
    constexpr double kReach = 1.3;
    const Polar at = polar_at(x, y);
    const bool inside = at.radius < kReach;
    const double c2 = std::cos(2 * at.azimuth), s2 = std::sin(2 * at.azimuth);
    const auto ring = [&](int order, double by) {
      out[k++] = inside ? std::cos(order * kPi * at.radius / kReach) * by : 0;
    };
    if (sphere_) {
      // Of a cross between polarizers, of all azimuths, of others.
      for (int order = 0; order < 14; ++order) ring(order, s2 * s2);
      for (int order = 0; order < 10; ++order) ring(order, 1);
      for (int order = 0; order < 6; ++order) ring(order, c2), ring(order, 2 * s2 * c2), ring(order, c2 * s2 * s2);
    } else {
      for (const double by : {1.0, c2, c2 * c2 - s2 * s2, s2})
        for (int order = 0; order < kDiscRings; ++order) ring(order, by);
    }
  }
  // Out of round, or pixels out of square: then its size is uncertain by as much, which itself leaves no trace.
  using Kind = PictureEffect::Kind;
  if (radius_px_)
    for (const Kind kind : {Kind::stretch_x, Kind::stretch_diagonal, Kind::growth})
      out[k++] = effect_at(kind, light_, x, y);
  out[k++] = effect_at(Kind::blur, light_, x, y);
}

std::array<std::size_t, 2> Patterns::parts_at(Eigen::Index pixel) const {
  const int x = pixels_[static_cast<std::size_t>(pixel)][0], y = pixels_[static_cast<std::size_t>(pixel)][1];
  if (!radius_px_)
    return {static_cast<std::size_t>(kParts * (x - used_.x0) / used_.width()),
            static_cast<std::size_t>(kParts * (y - used_.y0) / used_.height())};
  const Polar at = polar_at(x, y);
  const double turn = at.azimuth / (2 * kPi);
  return {static_cast<std::size_t>(kParts * (turn - std::floor(turn))) % kParts,
          static_cast<std::size_t>(std::min(kParts - 1.0, at.radius / 1.05 * (kParts - 1)))};
}

RowPatterns::RowPatterns(const Task& task, const LeastSquares& problem) {
  const Eigen::Index rows = task.frames();
  const Values<double> value(problem.theta(), {});
  std::vector<Eigen::VectorXd> columns;
  const auto add = [&](int group, const Eigen::VectorXd& column) {
    columns.push_back(column), group_.push_back(group);
  };
  // Whatever drifts: lamps, temperatures, what was measured one after another.
  constexpr int kDrifts = 4;
  for (int order = 1; order <= kDrifts; ++order) {
    Eigen::VectorXd column(rows);
    for (Eigen::Index g = 0; g < rows; ++g) column[g] = std::cos(kPi * order * (g + 0.5) / static_cast<double>(rows));
    add(kSlow, column);
  }
  Eigen::VectorXd light(rows);
  Eigen::MatrixXd by_unknown(rows, task.unknowns.size());
  for (Eigen::Index g = 0; g < rows; ++g) {
    const LeastSquares::FrameMisfit frame = problem.frame_misfit(static_cast<int>(g));
    light[g] = frame.mean_light;
    by_unknown.row(g) = frame.mean_noise_sd * frame.mean_jacobian_whitened.transpose();
  }
  // A law that is bent, and what is taken to be the same in all rows: unknowns that drift.
  constexpr int kBends = 3;
  for (Eigen::Index unknown = 0; unknown < std::ssize(task.unknowns.searched); ++unknown)
    for (int order = 1; order <= kBends; ++order)
      add(kLaw, by_unknown.col(unknown).cwiseProduct(columns[static_cast<std::size_t>(order - 1)]));
  // A detector that is not linear.
  const double low = light.minCoeff(), contrast = light.maxCoeff() - low;
  if (contrast > 0) light = (light.array() - low) / contrast;
  add(kNonlinear, light.array().square()), add(kNonlinear, light.array().cube());
  // Polarizers that are not quite such, beams that wander with what is turned.
  int group = kRings;
  const auto angle = [&](auto&& of) {
    Eigen::VectorXd radians(rows);
    for (Eigen::Index g = 0; g < rows; ++g) radians[g] = of(task.picture(static_cast<int>(g)).scene);
    constexpr double kTurned = 0.1;
    if (radians.maxCoeff() - radians.minCoeff() < kTurned) return;
    for (const int harmonic : {2, 4})
      add(group, (harmonic * radians.array()).cos()), add(group, (harmonic * radians.array()).sin());
    ++group;
  };
  angle([&](const Scene& scene) { return value.radians(scene.microscope.polarizer_deg); });
  angle([&](const Scene& scene) { return value.radians(scene.microscope.analyzer_deg); });
  angle([&](const Scene& scene) { return value.radians(scene.view.rotation_deg); });
  columns_.resize(rows, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) columns_.col(static_cast<Eigen::Index>(k)) = columns[k];
}

}  // namespace birefit::estimation
