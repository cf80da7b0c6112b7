// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The plain structs of base as serialised ROS 2 messages: XCDR1 with the 4-byte encapsulation
// header, as rosbag2 stores them. Needs no DDS and no generated type (library trigpoint::codec).
// Plain is one of ImuSample, GnssFix, PointCloudMessage, TwistMeasurement, YawMeasurement (an Imu
// on the wire), Odometry, Datum (a NavSatFix), GpsStatus, LioStatus, StateUpdate, FusionStatus.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace trigpoint::bus {

/// Little-endian bytes; always possible. Stamps beyond the int32 seconds of ROS are clamped.
template <class Plain>
std::vector<std::uint8_t> encode_cdr(const Plain& plain);

/// False, and `plain` unchanged, when the bytes are not that message: truncated, lengths beyond the
/// bytes, unknown encapsulation. Accepts both byte orders. Never allocates more than a small
/// multiple of the input's size.
template <class Plain>
bool decode_cdr(std::span<const std::uint8_t> cdr, Plain& plain);

/// The ROS 2 name of the message, e.g. "sensor_msgs/msg/Imu".
template <class Plain>
const char* ros_type_name();

}  // namespace trigpoint::bus
