// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Everything in ekf15 that depends on the order of measurements: the filter, the search for
// heading, the gate and its recovery.
#pragma once

#include "ekf15.hpp"
#include "heading.hpp"
#include "imu_checks.hpp"
#include "track.hpp"
#include "warm_start.hpp"
#include <Eigen/Core>

#include <string>

namespace trigpoint::gps_odometry {

struct EkfTrack : Track {
  Ekf15 filter;
  double gyro_bias_sigma_radps{0.0};
  double up_error_mps2{0.0};   ///< of the accelerometer along gravity, and of gravity
  bool knows_up_error{false};  ///< it was found at rest
  HeadingSearch heading;

  /// Variance of GPS error that is common to successive fixes (per axis of map): not seen by the
  /// filter, added to what is published.
  Eigen::Vector3d correlated_m2{Eigen::Vector3d::Zero()};
  /// Peak hold of what the receiver reported, while it reports less (a float before a fix), or of
  /// some dead reckoning. Fades slowly: nothing shows that a better solution is right.
  Eigen::Vector3d held_m2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d fix_m2{Eigen::Vector3d::Zero()};  ///< of the newest accepted fix

  /// A contradiction between fixes and filter that ended with following the fixes: its size, held
  /// in what is published, with health DEGRADED, until the stamp.
  Eigen::Vector3d doubt_m2{Eigen::Vector3d::Zero()};
  Nanoseconds doubt_until_ns{0};
  Eigen::Vector3d refused_innovation_m{Eigen::Vector3d::Zero()};  ///< of the newest refused fix
};

/// The rules by which measurements change a EkfTrack.
class EkfTracker {
 public:
  using State = EkfTrack;
  static constexpr const char* kSource = "ekf15";

  EkfTracker(const Config& config, const Eigen::Vector3d& lever_base_m);

  void apply(EkfTrack& track, const CheckedImu& imu) const;
  FixOutcome apply(EkfTrack& track, const MapFix& fix) const;
  /// Goes on from another filter's state; the phase becomes kRunning.
  void warm_start(EkfTrack& track, const WarmState& state) const;
  FixOutcome apply(EkfTrack& track, const CheckedTwist& twist) const;
  FixOutcome apply(EkfTrack& track, const Heading& yaw) const;

  /// Position of base_link with covariance as it may be published, order x y z roll pitch yaw about
  /// the axes of map.
  Pose pose(const EkfTrack& track) const;
  PoseCovariance pose_covariance(const EkfTrack& track) const;
  /// Velocity and rates in base_link with their covariance.
  Matrix6d twist_covariance(const EkfTrack& track) const;
  double yaw_sigma_rad(const EkfTrack& track) const;
  Estimate estimate(const EkfTrack& track) const;

  double speed_mps(const EkfTrack& track) const {
    return track.filter.x.segment<3>(kVelocity).norm();
  }

  /// The filter's own reason for health DEGRADED.
  bool is_doubtful(const EkfTrack& track) const;

  /// Whether an IMU that comes back after this time needs no new start.
  bool bridges(double) const { return false; }

  void change_frame(EkfTrack& track,
                    const Eigen::Matrix3d& R_new_old,
                    const Eigen::Vector3d& t_new_old) const;

 private:
  void start(EkfTrack& track, const CheckedImu& imu) const;
  void learn_at_rest(EkfTrack& track, const QuietWindow& quiet) const;
  void advance(EkfTrack& track, Nanoseconds stamp_ns) const;
  MotionNoise noise(const EkfTrack& track) const;

  CoursePoint course_point(const EkfTrack& track, const MapFix& fix) const;
  void prove_heading(EkfTrack& track, const MapFix& fix) const;
  FixOutcome align(EkfTrack& track, const MapFix& fix) const;
  void begin_running(EkfTrack& track, const MapFix& fix, const HeadingEstimate& heading) const;
  bool contradicts(const EkfTrack& track, const MapFix& fix) const;
  FixOutcome filter_fix(EkfTrack& track, const MapFix& fix) const;
  FixOutcome refuse(EkfTrack& track,
                    const MapFix& fix,
                    const std::string& reason,
                    const std::string& text) const;
  void recover(EkfTrack& track, const MapFix& fix) const;
  void recover_height(EkfTrack& track, const MapFix& fix) const;
  void accept(EkfTrack& track, const MapFix& fix) const;
  void readmit(EkfTrack& track, const MapFix& fix, bool with_height) const;
  bool follows_refused(const EkfTrack& track, const Eigen::Vector3d& innovation_m) const;
  void doubt_step(EkfTrack& track, const MapFix& fix) const;
  Eigen::Vector3d added_variance_m2(const EkfTrack& track) const;
  void hold_reported(EkfTrack& track, const MapFix& fix, double elapsed_s) const;
  void hold_correlated(EkfTrack& track, const MapFix& fix, double elapsed_s) const;
  double teleport_limit_m(const EkfTrack& track, const MapFix& fix) const;

  Config config_;
  Eigen::Vector3d lever_base_m_;
  double gate2_;  ///< chi-square limit, 2 degrees of freedom
  double gate1_;  ///< 1 degree of freedom
  double gate3_;  ///< 3 degrees of freedom
};

}  // namespace trigpoint::gps_odometry
