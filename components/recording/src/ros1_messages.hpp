// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <span>

namespace trigpoint::recording {

/// Decode a message in ROS 1's serialisation. False when the bytes are not that message.
bool decode_ros1(std::span<const std::uint8_t> bytes, ImuSample& imu);
bool decode_ros1(std::span<const std::uint8_t> bytes, GnssFix& fix);
bool decode_ros1(std::span<const std::uint8_t> bytes, PointCloudMessage& cloud);
bool decode_ros1(std::span<const std::uint8_t> bytes, TwistMeasurement& twist);
bool decode_ros1(std::span<const std::uint8_t> bytes, Odometry& odometry);
bool decode_ros1(std::span<const std::uint8_t> bytes, YawMeasurement& yaw);

}  // namespace trigpoint::recording
