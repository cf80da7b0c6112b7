// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// sensor_msgs/Imu and nav_msgs/Odometry of ROS 1 with their covariances, which the recording
// component does not keep because no process uses them.
#pragma once

#include "moore_stouch_replay.hpp"

#include <cstdint>
#include <span>
#include <string>

namespace trigpoint::gps_odometry {

/// Both throw std::out_of_range when the bytes are too few.
AhrsSample imu_of_ros1(std::span<const std::uint8_t> bytes);

struct OdometryTwist {
  std::string child_frame_id;
  TwistSample sample;
};

OdometryTwist twist_of_ros1(std::span<const std::uint8_t> bytes);

}  // namespace trigpoint::gps_odometry
