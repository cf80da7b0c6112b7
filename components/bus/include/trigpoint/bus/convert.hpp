// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Plain structs of base <-> generated message types. Wire conventions of ROS 2: covariances
// row-major (NavSatFix east north up; 6x6 x y z roll pitch yaw), quaternions x y z w, an Imu
// without attitude has orientation_covariance[0] = -1. What a message holds and the struct does not
// is written as "unknown" (zero covariance) and read past. Enumerators that are not known become
// the most cautious one. Numbers are not judged here: the cores check for NaN and range.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include "diagnostic_msgs.h"
#include "geometry_msgs.h"
#include "nav_msgs.h"
#include "rosgraph_msgs.h"
#include "sensor_msgs.h"
#include "tf2_msgs.h"
#include "trigpoint_msgs.h"

#include <span>
#include <string>
#include <vector>

namespace trigpoint::bus {

/// Stamps outside int32 seconds are clamped; nanosec is always below 1e9, also before 1970.
builtin_interfaces::msg::Time to_message(Nanoseconds stamp_ns);
sensor_msgs::msg::Imu to_message(const ImuSample& imu);
sensor_msgs::msg::NavSatFix to_message(const GnssFix& fix);
sensor_msgs::msg::PointCloud2 to_message(const PointCloudMessage& cloud);
nav_msgs::msg::Odometry to_message(const Odometry& odometry);
geometry_msgs::msg::TwistWithCovarianceStamped to_message(const TwistMeasurement& twist);
/// As the twist of an Odometry whose pose is unknown.
nav_msgs::msg::Odometry to_odometry_message(const TwistMeasurement& twist);
/// An Imu of which only the orientation is known.
sensor_msgs::msg::Imu to_message(const YawMeasurement& yaw);
sensor_msgs::msg::NavSatFix to_message(const Datum& datum);
trigpoint_msgs::msg::GpsStatus to_message(const GpsStatus& status);
trigpoint_msgs::msg::LioStatus to_message(const LioStatus& status);
trigpoint_msgs::msg::StateUpdate to_message(const StateUpdate& update);
trigpoint_msgs::msg::FusionStatus to_message(const FusionStatus& status);

Nanoseconds from_message(const builtin_interfaces::msg::Time& stamp);
ImuSample from_message(const sensor_msgs::msg::Imu& message);
GnssFix from_message(const sensor_msgs::msg::NavSatFix& message);
PointCloudMessage from_message(const sensor_msgs::msg::PointCloud2& message);
/// Takes the bytes over instead of copying them.
PointCloudMessage from_message(sensor_msgs::msg::PointCloud2&& message);
Odometry from_message(const nav_msgs::msg::Odometry& message);
TwistMeasurement twist_from_message(const geometry_msgs::msg::TwistWithCovarianceStamped& message);
/// The twist of an Odometry, which is in its child frame.
TwistMeasurement twist_from_message(const nav_msgs::msg::Odometry& message);
/// The orientation as it came, also when it is not of unit length: the core judges it.
YawMeasurement yaw_from_message(const sensor_msgs::msg::Imu& message);
Datum datum_from_message(const sensor_msgs::msg::NavSatFix& message);
GpsStatus from_message(const trigpoint_msgs::msg::GpsStatus& message);
LioStatus from_message(const trigpoint_msgs::msg::LioStatus& message);
StateUpdate from_message(const trigpoint_msgs::msg::StateUpdate& message);
FusionStatus from_message(const trigpoint_msgs::msg::FusionStatus& message);

/// A pose on its way into the tf tree.
struct StampedTransform {
  Nanoseconds stamp_ns{0};
  std::string frame_id;
  std::string child_frame_id;
  Pose T_frame_child;
};

tf2_msgs::msg::TFMessage to_tf_message(std::span<const StampedTransform> transforms);
std::vector<StampedTransform> from_message(const tf2_msgs::msg::TFMessage& message);

rosgraph_msgs::msg::Clock to_clock_message(Nanoseconds now_ns);
Nanoseconds from_message(const rosgraph_msgs::msg::Clock& message);

enum class DiagnosticLevel : std::uint8_t { kOk, kWarning, kError, kStale };

/// One line of `diagnostics`: a part of the process, how it does, and the numbers behind it.
struct Diagnostic {
  DiagnosticLevel level{DiagnosticLevel::kOk};
  std::string name;     ///< e.g. "fusion_gate: alignment"
  std::string message;  ///< a sentence
  std::string hardware_id;
  std::vector<std::pair<std::string, std::string>> values;
};

diagnostic_msgs::msg::DiagnosticArray to_message(Nanoseconds stamp_ns,
                                                 std::span<const Diagnostic> diagnostics);
std::vector<Diagnostic> from_message(const diagnostic_msgs::msg::DiagnosticArray& message);

}  // namespace trigpoint::bus
