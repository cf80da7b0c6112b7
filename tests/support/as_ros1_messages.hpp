// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Measurements as ROS 1's own generated messages: independent of our decoder. Those use
// std::allocator<void>::rebind, which C++20 has no more: whoever includes this is C++17.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>

namespace trigpoint::tests {

inline ros::Time ros_time(Nanoseconds stamp_ns) {
  return {static_cast<std::uint32_t>(stamp_ns / kNanosecondsPerSecond),
          static_cast<std::uint32_t>(stamp_ns % kNanosecondsPerSecond)};
}

inline sensor_msgs::Imu ros_imu(const ImuSample& imu) {
  sensor_msgs::Imu message;
  message.header.stamp = ros_time(imu.stamp_ns);
  message.header.frame_id = imu.frame_id;
  if (imu.q_world_base) {
    message.orientation.w = imu.q_world_base->w();
    message.orientation.x = imu.q_world_base->x();
    message.orientation.y = imu.q_world_base->y();
    message.orientation.z = imu.q_world_base->z();
  }
  message.angular_velocity.x = imu.gyro_radps.x();
  message.angular_velocity.y = imu.gyro_radps.y();
  message.angular_velocity.z = imu.gyro_radps.z();
  message.linear_acceleration.x = imu.accel_mps2.x();
  message.linear_acceleration.y = imu.accel_mps2.y();
  message.linear_acceleration.z = imu.accel_mps2.z();
  return message;
}

inline sensor_msgs::NavSatFix ros_fix(const GnssFix& fix) {
  sensor_msgs::NavSatFix message;
  message.header.stamp = ros_time(fix.stamp_ns);
  message.status.status = static_cast<std::int8_t>(fix.status);
  message.status.service = fix.service;
  message.latitude = fix.latitude_deg;
  message.longitude = fix.longitude_deg;
  message.altitude = fix.altitude_m;
  for (int i = 0; i < 9; ++i) {
    message.position_covariance[static_cast<std::size_t>(i)] = fix.covariance_enu_m2(i / 3, i % 3);
  }
  message.position_covariance_type = static_cast<std::uint8_t>(fix.covariance_type);
  return message;
}

inline sensor_msgs::PointCloud2 ros_cloud(const PointCloudMessage& cloud) {
  sensor_msgs::PointCloud2 message;
  message.header.stamp = ros_time(cloud.stamp_ns);
  message.header.frame_id = cloud.frame_id;
  message.height = cloud.height;
  message.width = cloud.width;
  for (const auto& field : cloud.fields) {
    sensor_msgs::PointField ros_field;
    ros_field.name = field.name;
    ros_field.offset = field.offset;
    ros_field.datatype = field.datatype;
    ros_field.count = field.count;
    message.fields.push_back(ros_field);
  }
  message.point_step = cloud.point_step;
  message.row_step = cloud.row_step;
  message.data = cloud.data;
  message.is_dense = 1;
  return message;
}

}  // namespace trigpoint::tests
