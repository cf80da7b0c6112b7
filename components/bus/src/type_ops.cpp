// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/backend.hpp"
#include "trigpoint/bus/topics.hpp"

#include "message_cdr.hpp"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <vector>

namespace trigpoint::bus::backend {

namespace {

/// "sensor_msgs::msg::dds_::Imu_" from "sensor_msgs/msg/Imu".
std::string dds_type_name(const std::string& ros_type) {
  const std::size_t first = ros_type.find('/');
  const std::size_t last = ros_type.rfind('/');
  if (first == std::string::npos || first == last) {
    throw std::invalid_argument("message type '" + ros_type +
                                "' is not spelled package/msg/Name as ROS 2 does");
  }
  return ros_type.substr(0, first) + "::msg::dds_::" + ros_type.substr(last + 1) + "_";
}

template <class T>
TypeOps make_ops(const char* ros_type) {
  TypeOps ops;
  ops.dds_name = dds_type_name(ros_type);
  ops.size_bound = [](const void* value) { return cdr_size_bound(*static_cast<const T*>(value)); };
  ops.serialize = [](const void* value, std::span<std::uint8_t> bytes) {
    return write_cdr(*static_cast<const T*>(value), bytes);
  };
  ops.deserialize = [](std::span<const std::uint8_t> bytes, void* value) {
    return read_cdr(bytes, *static_cast<T*>(value));
  };
  ops.make = []() -> std::shared_ptr<void> { return std::make_shared<T>(); };
  return ops;
}

using Bytes = std::vector<std::uint8_t>;

std::size_t copy_bytes(const void* value, std::span<std::uint8_t> out) {
  const Bytes& bytes = *static_cast<const Bytes*>(value);
  if (bytes.size() > out.size()) {
    return 0;
  }
  std::copy(bytes.begin(), bytes.end(), out.begin());
  return bytes.size();
}

}  // namespace

TypeOps serialized_ops(const std::string& ros_type) {
  TypeOps ops;
  ops.dds_name = dds_type_name(ros_type);
  ops.size_bound = [](const void* value) { return static_cast<const Bytes*>(value)->size(); };
  ops.serialize = copy_bytes;
  ops.deserialize = [](std::span<const std::uint8_t> bytes, void* value) {
    static_cast<Bytes*>(value)->assign(bytes.begin(), bytes.end());
    return is_plain_cdr(bytes);
  };
  ops.make = []() -> std::shared_ptr<void> { return std::make_shared<Bytes>(); };
  return ops;
}

#define TRIGPOINT_BUS_TYPE(T, ros_type)               \
  template <>                                         \
  const TypeOps& type_ops<T>() {                      \
    static const TypeOps ops = make_ops<T>(ros_type); \
    return ops;                                       \
  }

TRIGPOINT_BUS_TYPE(sensor_msgs::msg::Imu, "sensor_msgs/msg/Imu")
TRIGPOINT_BUS_TYPE(sensor_msgs::msg::NavSatFix, "sensor_msgs/msg/NavSatFix")
TRIGPOINT_BUS_TYPE(sensor_msgs::msg::PointCloud2, "sensor_msgs/msg/PointCloud2")
TRIGPOINT_BUS_TYPE(nav_msgs::msg::Odometry, "nav_msgs/msg/Odometry")
TRIGPOINT_BUS_TYPE(geometry_msgs::msg::TwistWithCovarianceStamped,
                   "geometry_msgs/msg/TwistWithCovarianceStamped")
TRIGPOINT_BUS_TYPE(tf2_msgs::msg::TFMessage, "tf2_msgs/msg/TFMessage")
TRIGPOINT_BUS_TYPE(diagnostic_msgs::msg::DiagnosticArray, "diagnostic_msgs/msg/DiagnosticArray")
TRIGPOINT_BUS_TYPE(rosgraph_msgs::msg::Clock, "rosgraph_msgs/msg/Clock")
TRIGPOINT_BUS_TYPE(trigpoint_msgs::msg::GpsStatus, "trigpoint_msgs/msg/GpsStatus")
TRIGPOINT_BUS_TYPE(trigpoint_msgs::msg::LioStatus, "trigpoint_msgs/msg/LioStatus")
TRIGPOINT_BUS_TYPE(trigpoint_msgs::msg::StateUpdate, "trigpoint_msgs/msg/StateUpdate")
TRIGPOINT_BUS_TYPE(trigpoint_msgs::msg::FusionStatus, "trigpoint_msgs/msg/FusionStatus")

#undef TRIGPOINT_BUS_TYPE

}  // namespace trigpoint::bus::backend
