// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cmath>

namespace trigpoint::simulator {

/// A turned rectangle in plan view: where something stands.
struct Footprint {
  Eigen::Vector2d centre_m{Eigen::Vector2d::Zero()};
  Eigen::Vector2d half_m{Eigen::Vector2d::Zero()};
  double yaw_rad{0.0};

  Eigen::Vector2d axis(int i) const {
    return i == 0 ? Eigen::Vector2d(std::cos(yaw_rad), std::sin(yaw_rad))
                  : Eigen::Vector2d(-std::sin(yaw_rad), std::cos(yaw_rad));
  }

  /// A place given along the rectangle's own axes, in map.
  Eigen::Vector2d to_map(double along_m, double across_m) const {
    return centre_m + along_m * axis(0) + across_m * axis(1);
  }

  /// 0 inside.
  double distance_m(const Eigen::Vector2d& point_m) const {
    const Eigen::Vector2d d = point_m - centre_m;
    const Eigen::Vector2d own(std::abs(d.dot(axis(0))), std::abs(d.dot(axis(1))));
    return (own - half_m).cwiseMax(0.0).norm();
  }

  /// Separating axes: two rectangles are apart exactly when one of the four axes shows a gap.
  bool overlaps(const Footprint& other) const {
    const Eigen::Vector2d d = other.centre_m - centre_m;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector2d along = k < 2 ? axis(k) : other.axis(k - 2);
      if (std::abs(d.dot(along)) > reach_m(along) + other.reach_m(along)) {
        return false;
      }
    }
    return true;
  }

 private:
  double reach_m(const Eigen::Vector2d& along) const {
    return half_m.x() * std::abs(axis(0).dot(along)) + half_m.y() * std::abs(axis(1).dot(along));
  }
};

}  // namespace trigpoint::simulator
