// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The ROS 2 messages of the bus as JSON, with ROS's names of fields: for comparison with what
// others make of the same bytes. Numbers that are not finite are text, since JSON has none.
#pragma once

#include "trigpoint/bus/topics.hpp"

#include <nlohmann/json.hpp>

#include <cmath>

namespace trigpoint::bus::testing {

using Json = nlohmann::ordered_json;

inline Json json_of(double value) {
  return std::isnan(value) ? Json("NaN") : Json(value);
}

template <std::size_t Count>
Json json_of(const std::array<double, Count>& values) {
  Json all = Json::array();
  for (const double value : values) {
    all.push_back(json_of(value));
  }
  return all;
}

template <class Message>
Json json_of(const std::vector<Message>& messages);

inline Json json_of(const builtin_interfaces::msg::Time& m) {
  return {{"sec", m.sec()}, {"nanosec", m.nanosec()}};
}

inline Json json_of(const std_msgs::msg::Header& m) {
  return {{"stamp", json_of(m.stamp())}, {"frame_id", m.frame_id()}};
}

inline Json json_of(const geometry_msgs::msg::Point& m) {
  return {{"x", json_of(m.x())}, {"y", json_of(m.y())}, {"z", json_of(m.z())}};
}

inline Json json_of(const geometry_msgs::msg::Vector3& m) {
  return {{"x", json_of(m.x())}, {"y", json_of(m.y())}, {"z", json_of(m.z())}};
}

inline Json json_of(const geometry_msgs::msg::Quaternion& m) {
  return {
      {"x", json_of(m.x())}, {"y", json_of(m.y())}, {"z", json_of(m.z())}, {"w", json_of(m.w())}};
}

inline Json json_of(const geometry_msgs::msg::PoseWithCovariance& m) {
  return {{"pose",
           {{"position", json_of(m.pose().position())},
            {"orientation", json_of(m.pose().orientation())}}},
          {"covariance", json_of(m.covariance())}};
}

inline Json json_of(const geometry_msgs::msg::TwistWithCovariance& m) {
  return {{"twist",
           {{"linear", json_of(m.twist().linear())}, {"angular", json_of(m.twist().angular())}}},
          {"covariance", json_of(m.covariance())}};
}

inline Json json_of(const geometry_msgs::msg::TwistWithCovarianceStamped& m) {
  return {{"header", json_of(m.header())}, {"twist", json_of(m.twist())}};
}

inline Json json_of(const geometry_msgs::msg::TransformStamped& m) {
  return {{"header", json_of(m.header())},
          {"child_frame_id", m.child_frame_id()},
          {"transform",
           {{"translation", json_of(m.transform().translation())},
            {"rotation", json_of(m.transform().rotation())}}}};
}

inline Json json_of(const sensor_msgs::msg::Imu& m) {
  return {{"header", json_of(m.header())},
          {"orientation", json_of(m.orientation())},
          {"orientation_covariance", json_of(m.orientation_covariance())},
          {"angular_velocity", json_of(m.angular_velocity())},
          {"angular_velocity_covariance", json_of(m.angular_velocity_covariance())},
          {"linear_acceleration", json_of(m.linear_acceleration())},
          {"linear_acceleration_covariance", json_of(m.linear_acceleration_covariance())}};
}

inline Json json_of(const sensor_msgs::msg::NavSatFix& m) {
  return {{"header", json_of(m.header())},
          {"status", {{"status", m.status().status()}, {"service", m.status().service()}}},
          {"latitude", json_of(m.latitude())},
          {"longitude", json_of(m.longitude())},
          {"altitude", json_of(m.altitude())},
          {"position_covariance", json_of(m.position_covariance())},
          {"position_covariance_type", m.position_covariance_type()}};
}

inline Json json_of(const sensor_msgs::msg::PointField& m) {
  return {
      {"name", m.name()}, {"offset", m.offset()}, {"datatype", m.datatype()}, {"count", m.count()}};
}

inline Json json_of(const sensor_msgs::msg::PointCloud2& m) {
  return {{"header", json_of(m.header())},
          {"height", m.height()},
          {"width", m.width()},
          {"fields", json_of(m.fields())},
          {"is_bigendian", m.is_bigendian()},
          {"point_step", m.point_step()},
          {"row_step", m.row_step()},
          {"data", m.data()},
          {"is_dense", m.is_dense()}};
}

inline Json json_of(const nav_msgs::msg::Odometry& m) {
  return {{"header", json_of(m.header())},
          {"child_frame_id", m.child_frame_id()},
          {"pose", json_of(m.pose())},
          {"twist", json_of(m.twist())}};
}

inline Json json_of(const tf2_msgs::msg::TFMessage& m) {
  return {{"transforms", json_of(m.transforms())}};
}

inline Json json_of(const rosgraph_msgs::msg::Clock& m) {
  return {{"clock", json_of(m.clock())}};
}

inline Json json_of(const diagnostic_msgs::msg::KeyValue& m) {
  return {{"key", m.key()}, {"value", m.value()}};
}

inline Json json_of(const diagnostic_msgs::msg::DiagnosticStatus& m) {
  return {{"level", m.level()},
          {"name", m.name()},
          {"message", m.message()},
          {"hardware_id", m.hardware_id()},
          {"values", json_of(m.values())}};
}

inline Json json_of(const diagnostic_msgs::msg::DiagnosticArray& m) {
  return {{"header", json_of(m.header())}, {"status", json_of(m.status())}};
}

template <class Message>
Json json_of(const std::vector<Message>& messages) {
  Json all = Json::array();
  for (const Message& message : messages) {
    all.push_back(json_of(message));
  }
  return all;
}

}  // namespace trigpoint::bus::testing
