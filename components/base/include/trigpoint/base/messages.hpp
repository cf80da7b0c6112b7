// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the three components say to each other: the plain twins of the messages in idl/.
// A component's core takes and returns these; the process shells convert them to the wire.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// nav_msgs/Odometry. The twist is in the child frame (REP-105).
struct Odometry {
  Nanoseconds stamp_ns{0};
  std::string frame_id;        ///< "map" or "odom"
  std::string child_frame_id;  ///< "base_link", or "gnss_antenna" from a plain GPS source
  Pose T_frame_child;
  PoseCovariance pose_covariance{PoseCovariance::Identity() * kUnknownVariance};
  Eigen::Vector3d linear_mps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d angular_radps{Eigen::Vector3d::Zero()};
  Matrix6d twist_covariance{Matrix6d::Identity() * kUnknownVariance};
};

/// The origin of `map`: on the wire a NavSatFix whose stamp is the time of its election.
struct Datum {
  double latitude_deg{kNaN};
  double longitude_deg{kNaN};
  double height_m{kNaN};      ///< above the WGS 84 ellipsoid
  Nanoseconds elected_ns{0};  ///< data time; 0 = given by configuration, which is older than any

  /// Equal for equal places: "lat lon h" with 1e-9 degree and 1e-4 m.
  std::string id() const;
};

enum class GpsHealth : std::uint8_t { kInit, kOk, kDegraded, kDeadReckoning, kStale, kFault };
enum class GnssClass : std::uint8_t { kNone, kUnknown, kCode, kSbas, kFloat, kFixed };

struct NamedCount {
  std::string name;
  std::uint64_t count{0};
};

/// Announced change of an estimate that its dynamics do not explain.
struct ResetInfo {
  std::uint32_t counter{0};
  YawPose delta;  ///< of the newest reset
};

/// What a GPS filter holds of one fix. A late fix that is put in its place behind newer ones
/// changes what is held of those.
struct FixRecord {
  Nanoseconds stamp_ns{0};
  bool accepted{false};
  std::string reason;  ///< why it was refused
  /// The posterior of the antenna at the stamp, in map; only of an accepted one.
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Constant(kNaN)};
  Eigen::Matrix3d covariance_map_m2{Eigen::Matrix3d::Identity() * kUnknownVariance};
};

struct GpsStatus {
  Nanoseconds stamp_ns{0};
  std::string source;  ///< program and version, e.g. "ekf15"
  GpsHealth health{GpsHealth::kInit};
  std::string datum_id;  ///< empty until there is a datum
  GnssClass gnss_class{GnssClass::kNone};
  Nanoseconds last_accepted_fix_ns{0};  ///< stamp of that fix; 0 = none yet
  /// The filter's posterior of the antenna at last_accepted_fix_ns, in map. One fix, one statement:
  /// the gate reads this and not the stream, so the rate of gps/odometry does not matter.
  Eigen::Vector3d accepted_antenna_map_m{Eigen::Vector3d::Constant(kNaN)};
  Eigen::Matrix3d accepted_covariance_map_m2{Eigen::Matrix3d::Identity() * kUnknownVariance};
  std::array<double, 3> test_ratio{};  ///< innovation^2 / (gate^2 S) per axis of map; > 1 refused
  std::uint64_t fixes_received{0};
  std::uint64_t fixes_accepted{0};
  std::vector<NamedCount> rejections;  ///< by reason
  std::uint64_t imu_received{0};
  ResetInfo reset;
  /// Of the fixes that a later one can still change, by stamp; with them a fix is told of also when
  /// a newer one came first. Empty: the filter keeps none, and last_accepted_fix_ns is all it
  /// tells.
  std::vector<FixRecord> recent_fixes;
};

enum class LioHealth : std::uint8_t { kInit, kOk, kDegraded, kLost, kStale };

struct LioStatus {
  Nanoseconds stamp_ns{0};      ///< of the newest scan's last point
  std::uint32_t odom_epoch{0};  ///< a new number: odom has a new origin
  LioHealth health{LioHealth::kInit};
  /// Share of the prior variance that the newest scan removed, axes of odom, x y z roll pitch yaw:
  /// 1 well constrained, 0 not seen at all.
  std::array<double, 6> observability{};
  std::array<double, 6> sigma{};  ///< m and rad, relative to the local map
  ResetInfo reset;
  bool aligned{false};  ///< T_map_odom holds
  YawPose T_map_odom;
  /// Order yaw, x, y, z, tilt x, tilt y.
  Matrix6d T_map_odom_covariance{Matrix6d::Identity() * kUnknownVariance};
  std::uint64_t rows_applied{0};
  std::uint64_t rows_refused{0};
  std::string last_refusal;  ///< why, and of which stamp
  Nanoseconds last_row_fix_ns{0};
  std::uint64_t scans_received{0};
  std::uint64_t scans_used{0};
  std::vector<NamedCount> scans_refused;  ///< by reason
  std::uint64_t imu_received{0};
  double distance_m{0.0};  ///< driven since the epoch began
  /// Computing time of the newest scan, its decoding included; the shell measures it.
  double scan_ms{0.0};
};

enum class AxisDecision : std::uint8_t { kLio, kFused, kCoast };
enum class UpdateMode : std::uint8_t { kRows, kOverwrite };

/// T_map_odom of an odom epoch, computed by the gate: the first one, or one that replaces what the
/// mapper has because it rested on GPS that was found out.
struct Alignment {
  std::uint32_t odom_epoch{0};
  YawPose T_map_odom;
  Eigen::Matrix4d covariance{Eigen::Matrix4d::Identity() * kUnknownVariance};  ///< yaw, x, y, z
  bool replaces{false};  ///< to be taken also by a mapper that is aligned
};

/// At most one per accepted fix. Rows z_i = e_i^T T_map_odom (p_odom_base + R_odom_base l).
struct StateUpdate {
  Nanoseconds fix_stamp_ns{0};
  UpdateMode mode{UpdateMode::kRows};
  std::array<AxisDecision, 3> decision{AxisDecision::kLio, AxisDecision::kLio, AxisDecision::kLio};
  Eigen::Vector3d position_map_m{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_map_m2{Eigen::Matrix3d::Identity() * kUnknownVariance};
  double inflation{1.0};  ///< the covariance is the fix's own times this; at least 1
  Eigen::Vector3d lever_arm_base_m{Eigen::Vector3d::Zero()};  ///< zero: the row is about base_link
  std::optional<Alignment> first_alignment;
};

enum class AxisSource : std::uint8_t { kNone, kLio, kFused, kGps };

struct AxisStatus {
  AxisSource source{AxisSource::kNone};
  double sigma_m{kNaN};  ///< of the GPS odometry
  double threshold_m{kNaN};
  std::string reason;  ///< e.g. "sigma 0.62 m > threshold 0.50 m"
};

struct FixVerdict {
  Nanoseconds fix_stamp_ns{0};
  bool used{false};
  std::string reason;
};

struct FusionStatus {
  Nanoseconds stamp_ns{0};
  std::string mode;  ///< lio, fusion, literal, hard
  std::array<AxisStatus, 3> axes;
  bool aligned{false};
  YawPose T_map_odom;
  double yaw_sigma_rad{kNaN};
  std::array<double, 3> position_sigma_m{kNaN, kNaN, kNaN};
  FixVerdict verdict;  ///< the newest one
  std::uint64_t fixes_seen{0};
  std::uint64_t fixes_used{0};
  std::vector<NamedCount> verdicts;  ///< by reason
  std::string gps_source;            ///< the writer that is followed
  std::vector<FixVerdict> judged;    ///< every verdict since the status before, in their order
};

}  // namespace trigpoint
