// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// All that a mapper must know of its past, besides keyframes, to go on after it was killed.
struct Checkpoint {
  Nanoseconds stamp_ns{0};  ///< of the newest scan's last point
  std::uint32_t odom_epoch{0};
  Pose T_odom_base;
  Eigen::Vector3d v_odom_mps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_bias_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_bias_mps2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gravity_odom_mps2{Eigen::Vector3d::Zero()};
  bool aligned{false};
  YawPose T_map_odom;  ///< without tilt: that is in the gravity
  /// Of the error state, in its order (README); square.
  Eigen::MatrixXd covariance;
  Matrix6d drift_covariance{Matrix6d::Zero()};  ///< of odom, about its origin, ROS order
  double distance_m{0.0};

  std::uint64_t next_keyframe{0};
  std::uint64_t scans_received{0};
  std::uint64_t scans_used{0};
  std::uint64_t imu_received{0};
  std::uint64_t rows_applied{0};
  std::uint64_t rows_refused{0};
  Nanoseconds last_row_fix_ns{0};
  ResetInfo reset;
  std::vector<NamedCount> scans_refused;
};

/// A GPS row that came to the mapper and what became of it.
struct StoredRow {
  StateUpdate update;  ///< without an alignment
  std::uint32_t odom_epoch{0};
  bool applied{false};
  std::string verdict;  ///< "applied", or why it was refused
};

/// A part of the stored map, in one odom epoch.
struct MapRegion {
  std::uint32_t odom_epoch{0};
  Eigen::Vector3d center_odom_m{Eigen::Vector3d::Zero()};
  double half_side_m{0.0};  ///< of the square, in x and y, in which the keyframes were taken
  /// Only the newest keyframes, back to the first one outside the square: what a local map holds
  /// that went along. An earlier visit may have drifted against it.
  bool recent_stretch{false};
};

/// Hands out the clouds of a region's keyframes, in odom, oldest first. Throws std::runtime_error
/// when they cannot be read.
using StoredPoints =
    std::function<void(const MapRegion&,
                       const std::function<void(const PointCloud& points_odom)>& visit)>;

}  // namespace trigpoint::lio_mapper
