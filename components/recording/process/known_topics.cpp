// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "known_topics.hpp"

#include "trigpoint/bus/topics.hpp"

#include <algorithm>

namespace trigpoint::recording {

namespace {

namespace topics = bus::topics;

template <typename T>
KnownTopic known(const bus::Topic<T>& topic,
                 const std::string& ros_type,
                 const std::string& name = {}) {
  return {name.empty() ? std::string(topic.name) : name, ros_type, topic.qos, false};
}

KnownTopic input(KnownTopic topic) {
  topic.from_sensor = true;
  return topic;
}

}  // namespace

std::vector<KnownTopic> known_topics(const RobotConfig& robot) {
  const std::string odometry = "nav_msgs/msg/Odometry";
  const std::string cloud = "sensor_msgs/msg/PointCloud2";
  const std::string fix = "sensor_msgs/msg/NavSatFix";
  const std::string tf = "tf2_msgs/msg/TFMessage";
  std::vector<KnownTopic> all{input(known(topics::points, cloud, robot.points_topic)),
                              input(known(topics::imu, "sensor_msgs/msg/Imu", robot.imu_topic)),
                              input(known(topics::fix, fix, robot.fix_topic)),
                              known(topics::clock, "rosgraph_msgs/msg/Clock"),
                              known(topics::gps_odometry, odometry),
                              known(topics::gps_status, "trigpoint_msgs/msg/GpsStatus"),
                              known(topics::gps_selected, odometry),
                              known(topics::lio_odometry, odometry),
                              known(topics::lio_odometry_imu_rate, odometry),
                              known(topics::lio_status, "trigpoint_msgs/msg/LioStatus"),
                              known(topics::state_update, "trigpoint_msgs/msg/StateUpdate"),
                              known(topics::fusion_odometry, odometry),
                              known(topics::fusion_odometry_raw, odometry),
                              known(topics::fusion_status, "trigpoint_msgs/msg/FusionStatus"),
                              known(topics::datum, fix),
                              known(topics::cloud_registered, cloud),
                              known(topics::map, cloud),
                              known(topics::tf, tf),
                              known(topics::tf_static, tf),
                              known(topics::diagnostics, "diagnostic_msgs/msg/DiagnosticArray"),
                              known(topics::clock_probe, "diagnostic_msgs/msg/DiagnosticArray")};
  const auto add = [&all](const KnownTopic& topic) {
    const auto same = [&topic](const KnownTopic& other) { return other.name == topic.name; };
    if (std::none_of(all.begin(), all.end(), same)) {
      all.push_back(input(topic));
    }
  };
  if (!robot.twist_topic.empty() && robot.twist_message == "Odometry") {
    add(known(topics::twist_odometry, odometry, robot.twist_topic));
  } else if (!robot.twist_topic.empty()) {
    add(known(topics::twist, "geometry_msgs/msg/TwistWithCovarianceStamped", robot.twist_topic));
  }
  if (!robot.yaw_topic.empty()) {
    add(known(topics::yaw, "sensor_msgs/msg/Imu", robot.yaw_topic));  // may be the IMU's own
  }
  return all;
}

}  // namespace trigpoint::recording
