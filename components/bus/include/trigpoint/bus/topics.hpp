// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Every topic of Trigpoint: name, type, QoS. The only table; idl/README.md tells it in words.
// Readers of sensors and odometry are RELIABLE and are made anew as BEST_EFFORT by Subscription
// when a writer offers only that. Depths: an IMU reader or writer that stalls for a second loses
// nothing at 1 kHz, and one of sweeps may stall for four seconds at 10 Hz.
#pragma once

#include "trigpoint/bus/qos.hpp"

#include "diagnostic_msgs.h"
#include "geometry_msgs.h"
#include "nav_msgs.h"
#include "rosgraph_msgs.h"
#include "sensor_msgs.h"
#include "tf2_msgs.h"
#include "trigpoint_msgs.h"

namespace trigpoint::bus::topics {

// The three sensor topics have the names of RobotConfig: `points.renamed(robot.points_topic)`.
inline constexpr Topic<sensor_msgs::msg::PointCloud2> points{
    "points",
    qos::kDefault.with_depth(40).as_bulk()};
inline constexpr Topic<sensor_msgs::msg::Imu> imu{"imu/data", qos::kDefault.with_depth(1000)};
inline constexpr Topic<sensor_msgs::msg::NavSatFix> fix{"gps/fix", qos::kDefault.with_depth(100)};

// Optional, and named by RobotConfig alone.
inline constexpr Topic<geometry_msgs::msg::TwistWithCovarianceStamped> twist{
    "twist",
    qos::kDefault.with_depth(100)};
inline constexpr Topic<nav_msgs::msg::Odometry> twist_odometry{"twist",
                                                               qos::kDefault.with_depth(100)};
inline constexpr Topic<sensor_msgs::msg::Imu> yaw{"yaw", qos::kDefault.with_depth(100)};

inline constexpr Topic<rosgraph_msgs::msg::Clock> clock{"clock", qos::kClock};

inline constexpr Topic<nav_msgs::msg::Odometry> gps_odometry{"gps/odometry",
                                                             qos::kDefault.with_depth(200)};
inline constexpr Topic<trigpoint_msgs::msg::GpsStatus> gps_status{"gps/status",
                                                                  qos::kDefault.with_depth(100)};
/// Latched: a filter that starts after another one's death finds there where that one was.
inline constexpr Topic<nav_msgs::msg::Odometry> gps_selected{"gps/selected",
                                                             qos::kTransientLocal.with_depth(200)};
inline constexpr Topic<nav_msgs::msg::Odometry> lio_odometry{"lio/odometry",
                                                             qos::kDefault.with_depth(200)};
inline constexpr Topic<nav_msgs::msg::Odometry> lio_odometry_imu_rate{
    "lio/odometry_imu_rate",
    qos::kDefault.with_depth(1000)};
inline constexpr Topic<trigpoint_msgs::msg::LioStatus> lio_status{"lio/status",
                                                                  qos::kDefault.with_depth(100)};
inline constexpr Topic<trigpoint_msgs::msg::StateUpdate> state_update{
    "fusion/state_update",
    qos::kDefault.with_depth(100)};
inline constexpr Topic<nav_msgs::msg::Odometry> fusion_odometry{"fusion/odometry",
                                                                qos::kDefault.with_depth(1000)};
inline constexpr Topic<nav_msgs::msg::Odometry> fusion_odometry_raw{"fusion/odometry_raw",
                                                                    qos::kDefault.with_depth(1000)};
inline constexpr Topic<trigpoint_msgs::msg::FusionStatus> fusion_status{
    "fusion/status",
    qos::kDefault.with_depth(100)};
inline constexpr Topic<sensor_msgs::msg::NavSatFix> datum{"datum", qos::kTransientLocal};
inline constexpr Topic<sensor_msgs::msg::PointCloud2> cloud_registered{"cloud_registered",
                                                                       qos::kDefault.as_bulk()};
inline constexpr Topic<sensor_msgs::msg::PointCloud2> map{"map", qos::kTransientLocal.as_bulk()};
inline constexpr Topic<tf2_msgs::msg::TFMessage> tf{"tf", qos::kTf};
inline constexpr Topic<tf2_msgs::msg::TFMessage> tf_static{"tf_static", qos::kTfStatic};
inline constexpr Topic<diagnostic_msgs::msg::DiagnosticArray> diagnostics{"diagnostics",
                                                                          qos::kDefault};
/// Questions and answers between the clock watches of several computers, as diagnostics so that
/// every tool can show them.
inline constexpr Topic<diagnostic_msgs::msg::DiagnosticArray> clock_probe{
    "clock_probe",
    qos::kSensorData.with_depth(20)};

}  // namespace trigpoint::bus::topics
