// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What every filter's Track has: plain data, a function of the sorted measurements up to its time,
// so that the rewind buffer can keep and restore it.
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include "aiding.hpp"
#include "fix_checks.hpp"
#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <string>

namespace trigpoint::gps_odometry {

enum class Phase : std::uint8_t {
  kNoImu,     ///< nothing yet
  kAligning,  ///< roll and pitch known; position follows the fixes; heading searched from motion
  kRunning    ///< the filter
};

/// A checked fix, placed in map.
struct MapFix {
  CheckedFix checked;
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_map_m2{Eigen::Matrix3d::Identity()};
  Eigen::Vector3d added_white_m2{Eigen::Vector3d::Zero()};  ///< its scatter beyond what it says
};

/// Fixes that were refused one after another and agree with each other.
struct RefusedStreak {
  int count{0};
  Nanoseconds first_ns{0};
  Nanoseconds last_ns{0};
  Eigen::Vector3d last_map_m{Eigen::Vector3d::Zero()};
};

struct Track {
  Phase phase{Phase::kNoImu};
  Nanoseconds stamp_ns{0};
  Nanoseconds imu_ns{0};

  Nanoseconds warm_ns{0};  ///< when another filter's odometry was taken over; 0: it was not

  // The newest accepted fix: what it left of the antenna's position.
  Nanoseconds accepted_ns{0};
  Eigen::Vector3d accepted_antenna_map_m{Eigen::Vector3d::Constant(kNaN)};
  Eigen::Matrix3d accepted_covariance_map_m2{Eigen::Matrix3d::Identity() * kUnknownVariance};
  GnssClass gnss_class{GnssClass::kNone};
  bool assumed_covariance{false};
  double fix_interval_s{0.0};  ///< smoothed, of accepted fixes
  double speed_mps{0.0};       ///< between the last two accepted fixes, while aligning

  RefusedStreak refused;
  RefusedStreak refused_height;
  Nanoseconds refused_ns{0};  ///< of the newest refused fix
  std::array<double, 3> test_ratio{};
  ResetInfo reset;
  Nanoseconds reset_ns{0};

  AidingState aiding;

  std::uint64_t accepted{0};
  std::uint64_t refused_gate{0};
  std::uint64_t refused_teleport{0};
  std::uint64_t refused_before_imu{0};
  std::uint64_t used_without_height{0};
  std::uint64_t recoveries{0};
  std::uint64_t not_finite{0};  ///< restarts after a step that was not finite
  std::uint64_t restored{0};    ///< covariances that were not positive
  std::uint64_t twists_refused{0};
  std::uint64_t yaws_refused{0};
  std::uint64_t yaws_contradicted{0};
};

/// Begun from another filter's odometry, and no fix has confirmed it since.
inline bool is_unconfirmed(const Track& track) {
  return track.phase == Phase::kRunning && track.warm_ns > 0 && track.accepted_ns <= track.warm_ns;
}

/// What a fix did; empty reason: accepted without remark.
struct FixOutcome {
  bool accepted{false};
  std::string reason;
  std::string text;
};

/// What is told of a fix that left the Track so.
FixRecord record_of(Nanoseconds stamp_ns, const FixOutcome& outcome, const Track& after);

/// Adds a refused fix; one that does not agree with the streak begins another.
void extend(RefusedStreak& streak, const MapFix& fix, double highest_speed_mps);

/// Refused fixes that agree with each other for so long are believed.
bool is_believed(const RefusedStreak& streak, double recovery_s);

/// What is common to all accepted fixes.
void note_accepted(Track& track, const MapFix& fix);

/// Least variance that is published, by class.
Eigen::Vector3d floor_variance_m2(const Track& track, const Config& config);

/// What is published of a Track.
struct Estimate {
  Pose T_map_base;
  /// x y z, roll pitch yaw about the axes of map.
  PoseCovariance pose_covariance{PoseCovariance::Identity() * kUnknownVariance};
  Eigen::Vector3d linear_base_mps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d angular_base_radps{Eigen::Vector3d::Zero()};
  Matrix6d twist_covariance{Matrix6d::Identity() * kUnknownVariance};
};

/// Before the heading is known there is no velocity of the body.
void forget_velocity(Estimate& estimate);

}  // namespace trigpoint::gps_odometry
