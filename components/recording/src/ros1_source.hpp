// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "bag_source.hpp"
#include "ros1_messages.hpp"

namespace trigpoint::recording {

/// A bag whose messages are in ROS 1's serialisation, however they are found.
class Ros1Source : public BagSource {
 public:
  bool decode(const RawMessage& raw, ImuSample& imu) const override {
    return decode_ros1(raw.bytes, imu);
  }

  bool decode(const RawMessage& raw, GnssFix& fix) const override {
    return decode_ros1(raw.bytes, fix);
  }

  bool decode(const RawMessage& raw, PointCloudMessage& cloud) const override {
    return decode_ros1(raw.bytes, cloud);
  }

  bool decode(const RawMessage& raw, TwistMeasurement& twist) const override {
    return decode_ros1(raw.bytes, twist);
  }

  bool decode(const RawMessage& raw, Odometry& odometry) const override {
    return decode_ros1(raw.bytes, odometry);
  }

  bool decode(const RawMessage& raw, YawMeasurement& yaw) const override {
    return decode_ros1(raw.bytes, yaw);
  }
};

}  // namespace trigpoint::recording
