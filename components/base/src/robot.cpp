// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/robot.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/so3.hpp"

namespace trigpoint {

Pose RobotConfig::T_base_lidar() const {
  return {from_roll_pitch_yaw(lidar_roll_pitch_yaw_base_rad), lidar_position_base_m};
}

Eigen::Quaterniond RobotConfig::q_base_imu() const {
  return from_roll_pitch_yaw(imu_roll_pitch_yaw_base_rad);
}

namespace {

/// A topic without which there is nothing to do.
void needed_topic(ConfigFields& fields,
                  const std::string& key,
                  std::string& topic,
                  const std::string& doc) {
  fields.text(key, topic, doc);
  if (topic.find_first_not_of("/ ") == std::string::npos) {
    throw ConfigError("robot." + key + " must name a topic; is '" + topic + "'");
  }
}

}  // namespace

void describe(RobotConfig& config, ConfigFields& fields) {
  fields.vector3("lidar_position_base_m",
                 config.lidar_position_base_m,
                 "LiDAR origin in base_link (at the IMU), x forward, y left, z up");
  fields.vector3("lidar_roll_pitch_yaw_base_rad",
                 config.lidar_roll_pitch_yaw_base_rad,
                 "R_base_lidar = Rz(yaw) Ry(pitch) Rx(roll)");
  fields.vector3("antenna_position_base_m",
                 config.antenna_position_base_m,
                 "GPS antenna's phase centre in base_link (the lever arm)");
  fields.vector3("imu_roll_pitch_yaw_base_rad",
                 config.imu_roll_pitch_yaw_base_rad,
                 "R_base_imu, when the IMU is mounted turned");
  needed_topic(fields,
               "points_topic",
               config.points_topic,
               "PointCloud2, in a log or on the bus, without a leading slash");
  needed_topic(fields, "imu_topic", config.imu_topic, "Imu");
  needed_topic(fields, "fix_topic", config.fix_topic, "NavSatFix");
  fields.text(
      "twist_topic",
      config.twist_topic,
      "Velocity by wheels or else, for gps_odometry; reversing must be negative. Empty: none");
  fields.choice("twist_message",
                config.twist_message,
                "Its type; of an Odometry the twist is used",
                {"TwistWithCovarianceStamped", "Odometry"});
  fields.text(
      "yaw_topic",
      config.yaw_topic,
      "Imu whose orientation is a heading by magnetometer or two antennas, for gps_odometry "
      "and fusion_gate; empty: none");
  fields.number(
      "yaw_offset_rad",
      config.yaw_offset_rad,
      "Added to a heading: magnetic declination (east is negative), mounting of the antennas",
      {-6.3, 6.3});
  fields.number("yaw_default_sigma_rad",
                config.yaw_default_sigma_rad,
                "Sigma of a heading without covariance",
                kPositive);
  fields.number(
      "yaw_floor_sigma_rad", config.yaw_floor_sigma_rad, "Least sigma of a heading", kPositive);
  fields.texts("imu_frame_ids",
               config.imu_frame_ids,
               "Frames in which IMU samples may be; others are refused. None listed: any");
  fields.texts("fix_frame_ids", config.fix_frame_ids, "The same for fixes");
  fields.texts("twist_frame_ids", config.twist_frame_ids, "The same for twists");
  fields.number("geoid_undulation_m",
                config.geoid_undulation_m,
                "Height of the geoid above the ellipsoid, added to the altitude of fixes: for "
                "drivers that send heights above the sea",
                {-120.0, 120.0});
}

}  // namespace trigpoint
