// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The fields of a point as the drivers of several makers write them.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::simulator {

struct CloudPoint {
  Eigen::Vector3f p_lidar_m{Eigen::Vector3f::Zero()};
  float intensity{0.0F};
  std::uint16_t ring{0};
  double time_s{0.0};  ///< after the cloud's stamp
};

/// velodyne: time (float32, s since the stamp). ouster: t (uint32, ns since the stamp). hesai:
/// timestamp (float64, absolute s). livox: timestamp (float64, absolute ns), line instead of ring.
/// no_time: x y z intensity ring only.
std::vector<std::string> cloud_layout_names();

/// Throws std::invalid_argument for a layout that is not in cloud_layout_names().
PointCloudMessage pack_cloud(const std::string& layout,
                             Nanoseconds stamp_ns,
                             const std::vector<CloudPoint>& points);

}  // namespace trigpoint::simulator
