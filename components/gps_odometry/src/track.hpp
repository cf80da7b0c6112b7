// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Everything in ekf15 that depends on the order of measurements: the filter, the search for
// heading, the gate and its recovery.
#pragma once

#include "ekf15.hpp"
#include "heading.hpp"
#include "imu_checks.hpp"
#include "track_state.hpp"
#include <Eigen/Core>

#include <string>

namespace trigpoint::gps_odometry {

struct Track : TrackState {
  Ekf15 filter;
  double gyro_bias_sigma_radps{0.0};
  HeadingSearch heading;

  /// Variance of GPS error that is common to successive fixes (per axis of map): not seen by the
  /// filter, added to what is published.
  Eigen::Vector3d correlated_m2{Eigen::Vector3d::Zero()};
};

/// The rules by which measurements change a Track.
class Tracker {
 public:
  using State = Track;
  static constexpr const char* kSource = "ekf15";

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
  Estimate estimate(const Track& track) const;

  double speed_mps(const Track& track) const { return track.filter.x.segment<3>(kVelocity).norm(); }

  /// The filter's own reason for health DEGRADED.
  bool is_doubtful(const Track& track) const;

  /// Whether an IMU that comes back after this time needs no new start.
  bool bridges(double) const { return false; }

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
  FixOutcome refuse(Track& track,
                    const MapFix& fix,
                    const std::string& reason,
                    const std::string& text) const;
  void recover(Track& track, const MapFix& fix) const;
  void recover_height(Track& track, const MapFix& fix) const;
  void accept(Track& track, const MapFix& fix) const;
  void hold_correlated(Track& track, const MapFix& fix, double elapsed_s) const;
  double teleport_limit_m(const Track& track, const MapFix& fix) const;

  Config config_;
  Eigen::Vector3d lever_base_m_;
  double gate2_;  ///< chi-square limit, 2 degrees of freedom
  double gate1_;  ///< 1 degree of freedom
};

}  // namespace trigpoint::gps_odometry
