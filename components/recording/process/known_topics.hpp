// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The topics of Trigpoint by name, ROS type and QoS, for programs that take all of them as bytes.
#pragma once

#include "trigpoint/base/robot.hpp"
#include "trigpoint/bus/qos.hpp"

#include <string>
#include <vector>

namespace trigpoint::recording {

struct KnownTopic {
  std::string name;      ///< without a leading slash
  std::string ros_type;  ///< e.g. "sensor_msgs/msg/Imu"
  bus::Qos qos;
  bool from_sensor{false};  ///< one of the inputs
};

/// The sensor topics under the names that `robot` gives them (twists and yaws where it has any),
/// and all others.
std::vector<KnownTopic> known_topics(const RobotConfig& robot);

}  // namespace trigpoint::recording
