// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <cstring>
#include <vector>

namespace trigpoint::simulator {

/// A Velodyne-like point of the tests, read by offset.
struct TestPoint {
  Eigen::Vector3d p_m;
  float intensity;
  std::uint16_t ring;
  float time_s;
};

inline std::vector<TestPoint> points_of(const PointCloudMessage& cloud) {
  std::vector<TestPoint> points;
  for (std::size_t at = 0; at < cloud.data.size(); at += cloud.point_step) {
    float xyzi[4];
    TestPoint point{};
    std::memcpy(xyzi, cloud.data.data() + at, sizeof xyzi);
    std::memcpy(&point.ring, cloud.data.data() + at + 16, 2);
    std::memcpy(&point.time_s, cloud.data.data() + at + 18, 4);
    point.p_m = Eigen::Vector3f(xyzi[0], xyzi[1], xyzi[2]).cast<double>();
    point.intensity = xyzi[3];
    points.push_back(point);
  }
  return points;
}

}  // namespace trigpoint::simulator
