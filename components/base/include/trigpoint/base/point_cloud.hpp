// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"

namespace trigpoint {

/// p_to = T_to_from p_from for every point; intensities stay. Computed in double, so that a cloud
/// far from the origin loses nothing but the rounding of its floats.
inline PointCloud moved(PointCloud points_from, const Pose& T_to_from) {
  for (PointXyzi& point : points_from) {
    const Eigen::Vector3f p = (T_to_from * point.position().cast<double>()).cast<float>();
    point = {p.x(), p.y(), p.z(), point.intensity};
  }
  return points_from;
}

}  // namespace trigpoint
