// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/cdr.hpp"

#include "trigpoint/bus/convert.hpp"

#include "message_cdr.hpp"

#include <utility>

namespace trigpoint::bus {

namespace {

template <class Plain>
struct Wire {
  using Message = decltype(to_message(std::declval<const Plain&>()));

  static Plain read(Message&& message) { return from_message(std::move(message)); }
};

template <>
Datum Wire<Datum>::read(Message&& message) {
  return datum_from_message(message);
}

template <>
TwistMeasurement Wire<TwistMeasurement>::read(Message&& message) {
  return twist_from_message(message);
}

template <>
YawMeasurement Wire<YawMeasurement>::read(Message&& message) {
  return yaw_from_message(message);
}

}  // namespace

template <class Plain>
std::vector<std::uint8_t> encode_cdr(const Plain& plain) {
  const auto message = to_message(plain);
  std::vector<std::uint8_t> bytes(cdr_size_bound(message));
  bytes.resize(write_cdr(message, bytes));
  return bytes;
}

template <class Plain>
bool decode_cdr(std::span<const std::uint8_t> cdr, Plain& plain) {
  typename Wire<Plain>::Message message;
  if (!read_cdr(cdr, message)) {
    return false;
  }
  plain = Wire<Plain>::read(std::move(message));
  return true;
}

#define TRIGPOINT_CODEC(Plain, ros_name)                                 \
  template std::vector<std::uint8_t> encode_cdr(const Plain&);           \
  template bool decode_cdr(std::span<const std::uint8_t>, Plain& plain); \
  template <>                                                            \
  const char* ros_type_name<Plain>() {                                   \
    return ros_name;                                                     \
  }

TRIGPOINT_CODEC(ImuSample, "sensor_msgs/msg/Imu")
TRIGPOINT_CODEC(GnssFix, "sensor_msgs/msg/NavSatFix")
TRIGPOINT_CODEC(PointCloudMessage, "sensor_msgs/msg/PointCloud2")
TRIGPOINT_CODEC(TwistMeasurement, "geometry_msgs/msg/TwistWithCovarianceStamped")
TRIGPOINT_CODEC(YawMeasurement, "sensor_msgs/msg/Imu")
TRIGPOINT_CODEC(Odometry, "nav_msgs/msg/Odometry")
TRIGPOINT_CODEC(Datum, "sensor_msgs/msg/NavSatFix")
TRIGPOINT_CODEC(GpsStatus, "trigpoint_msgs/msg/GpsStatus")
TRIGPOINT_CODEC(LioStatus, "trigpoint_msgs/msg/LioStatus")
TRIGPOINT_CODEC(StateUpdate, "trigpoint_msgs/msg/StateUpdate")
TRIGPOINT_CODEC(FusionStatus, "trigpoint_msgs/msg/FusionStatus")

#undef TRIGPOINT_CODEC

}  // namespace trigpoint::bus
