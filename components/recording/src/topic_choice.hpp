// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Which of a bag's topics are the points, the IMU, the fixes, the twists and the yaws.
#pragma once

#include "trigpoint/recording/log.hpp"

#include <string>

namespace trigpoint::recording {

/// Names as the log spells them; empty when the log lacks a topic that is not required, or the
/// robot has none.
struct TopicChoice {
  std::string points;
  std::string imu;
  std::string fix;
  std::string twist;
  bool twist_is_odometry{false};
  std::string yaw;  ///< may be the IMU's
};

/// Finds the topics that `robot` names, with or without a leading slash. Throws LogError when the
/// log is empty, or when a required topic is missing (naming the nearest one and all there are),
/// has no messages or another type.
TopicChoice choose_topics(const LogSummary& log,
                          const RobotConfig& robot,
                          const LogOptions& options);

/// "sensor_msgs/Imu" (ROS 1) as "sensor_msgs/msg/Imu".
std::string ros2_type_name(const std::string& type);

}  // namespace trigpoint::recording
