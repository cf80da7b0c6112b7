// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Everything that depends on the order of measurements: the filter, the search for heading, the
// gate and its recovery. A Track is plain data, a function of the sorted measurements up to its
// time, so that the rewind buffer can keep and restore it.
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include "ekf15.hpp"
#include "fix_checks.hpp"
#include "heading.hpp"
#include "imu_checks.hpp"
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
  Ekf15 filter;
  double gyro_bias_sigma_radps{0.0};
  HeadingSearch heading;

  // The newest accepted fix: what it left of the antenna's position.
  Nanoseconds accepted_ns{0};
  Eigen::Vector3d accepted_antenna_map_m{Eigen::Vector3d::Constant(kNaN)};
  Eigen::Matrix3d accepted_covariance_map_m2{Eigen::Matrix3d::Identity() * kUnknownVariance};
  GnssClass gnss_class{GnssClass::kNone};
  bool assumed_covariance{false};
  double fix_interval_s{0.0};  ///< smoothed, of accepted fixes
  double speed_mps{0.0};       ///< between the last two accepted fixes, while aligning

  /// Variance of GPS error that is common to successive fixes (per axis of map): not seen by the
  /// filter, added to what is published.
  Eigen::Vector3d correlated_m2{Eigen::Vector3d::Zero()};

  RefusedStreak refused;
  RefusedStreak refused_height;
  Nanoseconds refused_ns{0};  ///< of the newest refused fix
  std::array<double, 3> test_ratio{};
  ResetInfo reset;
  Nanoseconds reset_ns{0};

  std::uint64_t accepted{0};
  std::uint64_t refused_gate{0};
  std::uint64_t refused_teleport{0};
  std::uint64_t refused_before_imu{0};
  std::uint64_t used_without_height{0};
  std::uint64_t recoveries{0};
  std::uint64_t not_finite{0};  ///< restarts after a step that was not finite
};

/// What a fix did; empty reason: accepted without remark.
struct FixOutcome {
  bool accepted{false};
  std::string reason;
  std::string text;
};

/// The rules by which measurements change a Track.
class Tracker {
 public:
  Tracker(const Config& config, const Eigen::Vector3d& lever_base_m);

  void apply(Track& track, const CheckedImu& imu) const;
  FixOutcome apply(Track& track, const MapFix& fix) const;

  /// Position of base_link with covariance as it may be published, order x y z roll pitch yaw about
  /// the axes of map.
  Pose pose(const Track& track) const;
  PoseCovariance pose_covariance(const Track& track) const;
  /// Velocity and rates in base_link with their covariance.
  Matrix6d twist_covariance(const Track& track) const;
  double yaw_sigma_rad(const Track& track) const;

  void change_frame(Track& track,
                    const Eigen::Matrix3d& R_new_old,
                    const Eigen::Vector3d& t_new_old) const;

 private:
  void start(Track& track, const CheckedImu& imu) const;
  void advance(Track& track, Nanoseconds stamp_ns) const;
  MotionNoise noise(const Track& track) const;

  FixOutcome align(Track& track, const MapFix& fix) const;
  void begin_running(Track& track, const MapFix& fix, const HeadingEstimate& heading) const;
  FixOutcome filter_fix(Track& track, const MapFix& fix) const;
  bool agrees(const RefusedStreak& streak, const MapFix& fix) const;
  bool extend(RefusedStreak& streak, const MapFix& fix) const;
  FixOutcome refuse(Track& track,
                    const MapFix& fix,
                    const std::string& reason,
                    const std::string& text) const;
  void recover(Track& track, const MapFix& fix) const;
  void recover_height(Track& track, const MapFix& fix) const;
  void accept(Track& track, const MapFix& fix) const;
  void hold_correlated(Track& track, const MapFix& fix, double elapsed_s) const;
  double teleport_limit_m(const Track& track, const MapFix& fix) const;
  Eigen::Vector3d floor_variance_m2(const Track& track) const;

  Config config_;
  Eigen::Vector3d lever_base_m_;
  double gate2_;  ///< chi-square limit, 2 degrees of freedom
  double gate1_;  ///< 1 degree of freedom
};

}  // namespace trigpoint::gps_odometry
