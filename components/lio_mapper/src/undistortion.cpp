// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "undistortion.hpp"

#include <algorithm>
#include <array>

namespace trigpoint::lio_mapper {

namespace {

constexpr int kBins = 200;
using Transform = Eigen::Matrix<float, 3, 4>;

Transform matrix_of(const Pose& T) {
  Transform matrix;
  matrix.leftCols<3>() = T.q.toRotationMatrix().cast<float>();
  matrix.col(3) = T.p.cast<float>();
  return matrix;
}

/// T_end_lidar at the edges of the bins.
std::array<Transform, kBins + 1> tabulate(const Sweep& sweep,
                                          const Path& path,
                                          const Pose& T_base_lidar) {
  const Pose T_end_odom = path.at(sweep.end_ns).inverse();
  std::array<Transform, kBins + 1> table;
  for (int i = 0; i <= kBins; ++i) {
    const Nanoseconds stamp_ns = sweep.begin_ns + (sweep.end_ns - sweep.begin_ns) * i / kBins;
    table[static_cast<std::size_t>(i)] = matrix_of(T_end_odom * path.at(stamp_ns) * T_base_lidar);
  }
  return table;
}

}  // namespace

PointCloud undistort(const Sweep& sweep, const Path& path, const Pose& T_base_lidar) {
  const auto table = tabulate(sweep, path, T_base_lidar);
  const auto duration_s = static_cast<float>(to_seconds(sweep.end_ns - sweep.begin_ns));
  const float bins_per_s = duration_s > 0.0F ? static_cast<float>(kBins) / duration_s : 0.0F;
  PointCloud points_base;
  points_base.reserve(sweep.points.size());
  for (const TimedPoint& point : sweep.points) {
    const float position = std::clamp(point.time_s * bins_per_s, 0.0F, static_cast<float>(kBins));
    const int bin = std::min(static_cast<int>(position), kBins - 1);
    const float fraction = position - static_cast<float>(bin);
    const Transform& from = table[static_cast<std::size_t>(bin)];
    const Transform& to = table[static_cast<std::size_t>(bin) + 1];
    const Eigen::Vector4f p{point.x, point.y, point.z, 1.0F};
    const Eigen::Vector3f early = from * p;
    const Eigen::Vector3f late = to * p;
    const Eigen::Vector3f q = early + fraction * (late - early);
    points_base.push_back({q.x(), q.y(), q.z(), point.intensity});
  }
  return points_base;
}

}  // namespace trigpoint::lio_mapper
