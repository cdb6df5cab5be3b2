#pragma once
// A camera in space that looks at a screen: rays through a pinhole, cut with the plane of the screen. Shares nothing
// with src/.

#include <cmath>
#include <utility>

#include <Eigen/Dense>

namespace birefit::testing {

/// The screen is z = 0, the camera stands in the direction (tan tilt_x, tan tilt_y, 1) of its origin and looks at that.
/// Lengths in units of what half the picture's smaller side shows of a screen across the line of sight.
struct IndependentCamera {
  double tilt_x_deg = 0, tilt_y_deg = 0, half_field_deg = 0;

  /// Where the line of sight through (x, y) of the picture, in half smaller sides from its middle, meets the screen.
  std::pair<double, double> on_screen(double x, double y) const {
    const Eigen::Vector3d towards =
        Eigen::Vector3d(std::tan(tilt_x_deg * M_PI / 180), std::tan(tilt_y_deg * M_PI / 180), 1).normalized();
    // Turned there from above the screen by the shortest way.
    const Eigen::Vector3d up = Eigen::Vector3d::UnitZ(), axis = up.cross(towards);
    const Eigen::Quaterniond turn = Eigen::Quaterniond(1 + up.dot(towards), axis.x(), axis.y(), axis.z()).normalized();
    const Eigen::Vector3d seen = turn * Eigen::Vector3d(x, y, 0);
    if (half_field_deg == 0) {  // parallel lines of sight
      const Eigen::Vector3d p = seen - seen.z() / towards.z() * towards;
      return {p.x(), p.y()};
    }
    const Eigen::Vector3d pinhole = towards / std::tan(half_field_deg * M_PI / 180), along = seen - pinhole,
                          p = pinhole - pinhole.z() / along.z() * along;
    return {p.x(), p.y()};
  }
};

}  // namespace birefit::testing
