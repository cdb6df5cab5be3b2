#pragma once
// What may be between a picture and its model: patterns over the picture, in groups whose members are as likely as one
// another, and the parts that may each be wrong by themselves.

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Dense>

#include "fit/problem/effects.h"
#include "fit/problem/least_squares.h"
#include "fit/problem/task.h"

namespace birefit::estimation {

/// Of one picture of a fit, at the last evaluated point of its problem.
class Patterns {
 public:
  static constexpr int kGroups = 10;
  static constexpr int kParts = 12;

  Patterns(const Task& task, const LeastSquares& problem, int picture = 0);
  int count() const { return static_cast<int>(group_.size()); }
  /// Of a pattern, below kGroups.
  int group(int pattern) const { return group_[static_cast<std::size_t>(pattern)]; }
  /// All of them at a used pixel, in no unit.
  void at(Eigen::Index pixel, Eigen::Ref<Eigen::VectorXd> patterns) const;
  /// Which two of kParts a used pixel is in: of what is round a sector and a ring (the last one is all outside), else a
  /// column and a row.
  std::array<std::size_t, 2> parts_at(Eigen::Index pixel) const;

 private:
  /// About the centre of what is round: in radii, and from where its patterns count.
  struct Polar {
    double radius, azimuth;
  };
  Polar polar_at(int x, int y) const;
  void add_group(int group, int patterns);

  const std::vector<std::array<int, 2>>& pixels_;
  PixelRect used_;          ///< around the used pixels
  KnownLight light_;        ///< the model's over the picture, from 0 to 1
  Eigen::MatrixXd cosine_;  ///< of an order along either side of those, by the pixel
  bool sphere_;
  std::optional<double> radius_px_;  ///< of what is round
  double from_ = 0;                  ///< rad
  std::vector<int> group_;
};

/// Of frames that are one number each, in their order.
class RowPatterns {
 public:
  RowPatterns(const Task& task, const LeastSquares& problem);
  int count() const { return static_cast<int>(columns_.cols()); }
  /// Of a pattern, below Patterns::kGroups.
  int group(int pattern) const { return group_[static_cast<std::size_t>(pattern)]; }
  Eigen::VectorXd of(int frame) const { return columns_.row(frame); }

 private:
  Eigen::MatrixXd columns_;
  std::vector<int> group_;
};

}  // namespace birefit::estimation
