// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Which of a bag's topics are the points, the IMU and the fixes.
#pragma once

#include "trigpoint/recording/log.hpp"

#include <string>

namespace trigpoint::recording {

/// Names as the log spells them; empty when the log lacks a topic that is not required.
struct TopicChoice {
  std::string points;
  std::string imu;
  std::string fix;
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
