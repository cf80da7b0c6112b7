// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ekf_tracker.hpp"

#include "trigpoint/base/so3.hpp"

#include "chi_square.hpp"
#include "gravity.hpp"
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kEkfTiltSigma_rad = 0.1;  // of a first levelling in motion
constexpr double kEkfUnknownYaw_rad = std::numbers::pi;
constexpr double kEkfLongGap_s = 1.0;     // IMU gap after which attitude and velocity are doubted
constexpr double kEkfRestartGap_s = 5.0;  // IMU gap after which nothing is left
constexpr double kEkfTeleportMargin_m = 5.0;
constexpr double kEkfAligningSpeedSigma_mps = 1.0;
constexpr double kGyroBiasGrowth = 3.3;
constexpr double kAccelBiasGrowth = 3.0;
constexpr double kIgnoredHeight_m2 = 1e8;
// Share of an accelerometer's error that is left once it was seen (upwards at rest): on a slope of
// 10 degrees the horizontal errors add 17 %, and it wanders by a third until the next rest.
constexpr double kErrorLeft = 0.4;
constexpr double kSteep_rad = 1.4;  // roll pitch yaw become singular at pitch 90 degrees

}  // namespace

EkfTracker::EkfTracker(const Config& config, const Vector3d& lever_base_m)
    : config_(config),
      lever_base_m_(lever_base_m),
      gate2_(chi_square_limit_2(config.gate_probability)),
      gate1_(chi_square_limit_1(config.gate_probability)),
      gate3_(chi_square_limit_3(config.gate_probability)) {}

// ---- IMU ----------------------------------------------------------------------------------------

void EkfTracker::start(EkfTrack& track, const CheckedImu& imu) const {
  track.phase = Phase::kAligning;
  track.warm_ns = 0;
  track.filter = Ekf15{};
  // Level: the mean specific force is up. Heading stays open: 0 in a frame of its own.
  const Eigen::Quaterniond level = rotation_between(imu.mean_accel_mps2, Vector3d::UnitZ());
  track.filter.x.segment<3>(kAttitude) = roll_pitch_yaw_of(from_yaw(-yaw_of(level)) * level);
  track.filter.x.segment<3>(kRate) = imu.gyro_radps;
  Vector15d sigma;
  sigma << 1.0, 1.0, 1.0, kEkfTiltSigma_rad, kEkfTiltSigma_rad, 1e-3, 3.0, 3.0, 1.0, 0.1, 0.1, 0.1,
      1.0, 1.0, 1.0;
  track.filter.P = sigma.cwiseAbs2().asDiagonal();
  track.heading.restart();
  track.aiding = AidingState{};
  // The IMU's clock may have moved: what was stamped before says nothing any more.
  track.doubt_m2.setZero();
  track.doubt_until_ns = 0;
}

MotionNoise EkfTracker::noise(const EkfTrack& track) const {
  // The state has no biases. Without fixes a constant accelerometer bias b makes the position's
  // variance b^2 t^4 / 4; a random walk of the velocity with the rate 3 b^2 t makes the same. For a
  // gyro bias through the tilt, b^2 g^2 t^6 / 36, the rate is 3.3 b^2 t. So the rates grow with the
  // age of the last fix, from what fixes cannot see on.
  const Nanoseconds known_ns = std::max(track.accepted_ns, track.warm_ns);
  const double age_s = known_ns > 0 ? to_seconds(track.stamp_ns - known_ns) : 0.0;
  const double gyro_horizon_s = std::max(config_.gyro_bias_horizon_s, kGyroBiasGrowth * age_s);
  const double accel_horizon_s = std::max(config_.accel_bias_horizon_s, kAccelBiasGrowth * age_s);
  MotionNoise noise;
  noise.attitude_rad_sqrts = std::hypot(config_.attitude_noise_rad_sqrts,
                                        track.gyro_bias_sigma_radps * std::sqrt(gyro_horizon_s));
  // A horizontal accelerometer bias b is taken for the tilt b / g. It turns with the body, the tilt
  // does not: while turning at w their difference changes by b w / g, in a sense that lasts for
  // 1 / w. As white noise (2 sigma^2 tau) this is 2 (b / g)^2 for each radian turned.
  const double bias_tilt_rad = config_.accel_bias_sigma_mps2 / kGravity_mps2;
  // What the gyro's noise shows is no turn.
  const double turn_radps =
      std::max(0.0, track.filter.x.segment<3>(kRate).norm() - 3.0 * config_.gyro_sigma_radps);
  noise.tilt_rad_sqrts = bias_tilt_rad * std::sqrt(2.0 * turn_radps);
  // So of the horizontal errors only what wanders is left for the velocity; upwards, where no tilt
  // can stand for it, the whole until a rest has shown it.
  const double velocity_mps_sqrts = config_.accel_bias_sigma_mps2 * std::sqrt(accel_horizon_s);
  noise.velocity_mps_sqrts = kErrorLeft * velocity_mps_sqrts;
  const double up_share = track.knows_up_error ? kErrorLeft : 1.0;
  noise.velocity_up_mps_sqrts = up_share * velocity_mps_sqrts;
  noise.rate_radps_sqrts = config_.rate_noise_radps_sqrts;
  noise.acceleration_sigma_mps2 = config_.acceleration_sigma_mps2;
  noise.acceleration_tau_s = config_.acceleration_tau_s;
  return noise;
}

void EkfTracker::advance(EkfTrack& track, Nanoseconds stamp_ns) const {
  predict(
      track.filter, to_seconds(stamp_ns - track.stamp_ns), config_.longest_step_s, noise(track));
  track.stamp_ns = std::max(track.stamp_ns, stamp_ns);
}

void EkfTracker::apply(EkfTrack& track, const CheckedImu& imu) const {
  const double gap_s = to_seconds(imu.stamp_ns - track.imu_ns);
  if (track.phase == Phase::kNoImu || gap_s > kEkfRestartGap_s) {
    start(track, imu);
  } else {
    advance(track, imu.stamp_ns);
    if (gap_s > kEkfLongGap_s) {
      reset_block(track.filter, kVelocity, Matrix3d::Identity() * 9.0);
      track.filter.P.block<3, 3>(kAttitude, kAttitude).diagonal().array() +=
          gap_s * kEkfTiltSigma_rad * kEkfTiltSigma_rad;
    }
    if (imu.quiet) {
      learn_at_rest(track, *imu.quiet);
    }
    if (!is_saturated(imu, config_)) {  // else motion is as unknown as without a sample
      update_imu(track.filter,
                 imu.gyro_radps,
                 imu.accel_mps2 - track.up_error_mps2 * imu.mean_accel_mps2.normalized(),
                 config_.gyro_sigma_radps,
                 config_.accel_sigma_mps2);
    }
  }
  track.stamp_ns = std::max(track.stamp_ns, imu.stamp_ns);
  track.imu_ns = imu.stamp_ns;
  track.gyro_bias_sigma_radps = imu.gyro_bias_sigma_radps;
}

// ---- fixes --------------------------------------------------------------------------------------

FixOutcome EkfTracker::apply(EkfTrack& track, const MapFix& fix) const {
  if (track.phase == Phase::kNoImu) {
    ++track.refused_before_imu;
    return {false, "before_imu", "Fix refused: there is no usable IMU sample yet."};
  }
  advance(track, fix.checked.stamp_ns);
  const bool lost =
      track.phase == Phase::kRunning && (yaw_sigma_rad(track) > config_.heading_lost_rad ||
                                         (is_unconfirmed(track) && contradicts(track, fix)));
  if (track.phase == Phase::kRunning) {
    doubt_step(track, fix);
  }
  if (lost) {
    track.phase = Phase::kAligning;
    track.heading.restart();
    track.accepted_ns = 0;  // whatever the fix says is better than this
  }
  return track.phase == Phase::kAligning ? align(track, fix) : filter_fix(track, fix);
}

/// A start from another filter's word that the very first fix contradicts was a wrong one.
bool EkfTracker::contradicts(const EkfTrack& track, const MapFix& fix) const {
  const auto H = antenna_jacobian(track.filter.x, lever_base_m_);
  const Vector3d innovation = fix.antenna_map_m - expected_antenna(track.filter.x, lever_base_m_);
  const Matrix3d S = H * track.filter.P * H.transpose() + fix.covariance_map_m2;
  return !(innovation.head<2>().dot(S.topLeftCorner<2, 2>().ldlt().solve(innovation.head<2>())) <=
           gate2_);
}

void EkfTracker::warm_start(EkfTrack& track, const WarmState& state) const {
  Ekf15& filter = track.filter;
  filter.x.segment<3>(kPosition) = state.T_map_base.p;
  filter.x.segment<3>(kAttitude) = roll_pitch_yaw_of(state.T_map_base.q);
  filter.x.segment<3>(kVelocity) = state.linear_base_mps;
  reset_block(filter, kPosition, state.position_covariance_m2);
  // Changes of roll, pitch, yaw from small rotations about the axes of map.
  const Matrix3d J =
      euler_from_body_rates(filter.x.segment<3>(kAttitude)) * filter.R_map_base().transpose();
  reset_block(filter, kAttitude, J * state.rotation_covariance_rad2 * J.transpose());
  reset_block(filter, kVelocity, state.velocity_covariance_m2ps2);
  track.phase = Phase::kRunning;
  track.warm_ns = track.stamp_ns;
}

double EkfTracker::teleport_limit_m(const EkfTrack& track, const MapFix& fix) const {
  const double elapsed_s = to_seconds(fix.checked.stamp_ns - track.accepted_ns);
  const double variance = fix.covariance_map_m2.diagonal().maxCoeff() +
                          track.accepted_covariance_map_m2.diagonal().maxCoeff();
  return config_.highest_speed_mps * std::abs(elapsed_s) + kEkfTeleportMargin_m +
         5.0 * std::sqrt(variance);
}

FixOutcome EkfTracker::align(EkfTrack& track, const MapFix& fix) const {
  const Vector3d step = fix.antenna_map_m - track.accepted_antenna_map_m;
  if (track.accepted_ns > 0 && step.norm() > teleport_limit_m(track, fix)) {
    return refuse(track,
                  fix,
                  "teleport",
                  "it is " + std::to_string(step.norm()) +
                      " m from the last one, expected at most " +
                      std::to_string(teleport_limit_m(track, fix)) + " m.");
  }
  const double elapsed_s = to_seconds(fix.checked.stamp_ns - track.accepted_ns);
  if (track.accepted_ns > 0 && elapsed_s > 0.0) {
    track.speed_mps = step.head<2>().norm() / elapsed_s;
  }
  const CoursePoint point = course_point(track, fix);
  auto heading = track.heading.add(point, config_);
  if (!heading && track.accepted_ns > 0) {
    heading = heard_heading(track.aiding, step.head<2>(), elapsed_s, point.sigma_m);
  }
  if (heading) {
    begin_running(track, fix, *heading);
  } else {
    // Nothing else holds the velocity meanwhile; without a bound it would upset roll and pitch.
    const double speed = track.speed_mps;
    update_velocity(track.filter, {speed, 0.0, 0.0}, Vector3d(1.0 + 0.5 * speed, 1.0, 1.0));
  }
  accept(track, fix);
  return {true, "", ""};
}

void EkfTracker::begin_running(EkfTrack& track,
                               const MapFix& fix,
                               const HeadingEstimate& heading) const {
  Ekf15& filter = track.filter;
  const Vector3d before = pose(track).p;
  filter.x(kAttitude + 2) = wrap_angle(filter.x(kAttitude + 2) + heading.yaw_map_relative_rad);
  filter.P.row(kAttitude + 2).setZero();
  filter.P.col(kAttitude + 2).setZero();
  filter.P(kAttitude + 2, kAttitude + 2) = heading.sigma_rad * heading.sigma_rad;
  filter.x.segment<3>(kVelocity) = Vector3d(heading.speed_mps, 0.0, 0.0);
  if (heading.heard) {
    const Eigen::Vector2d& v = heading.velocity_map_mps;
    filter.x.segment<3>(kVelocity) = filter.R_map_base().transpose() * Vector3d(v.x(), v.y(), 0.0);
  }
  reset_block(
      filter, kVelocity, Matrix3d::Identity() * heading.speed_sigma_mps * heading.speed_sigma_mps);
  const Vector3d lever_map = filter.R_map_base() * lever_base_m_;
  filter.x.segment<3>(kPosition) = fix.antenna_map_m - lever_map;
  const Matrix3d lever_part =
      lever_map.squaredNorm() *
      (kEkfTiltSigma_rad * kEkfTiltSigma_rad + heading.sigma_rad * heading.sigma_rad) *
      Matrix3d::Identity();
  reset_block(filter, kPosition, fix.covariance_map_m2 + lever_part);
  track.phase = Phase::kRunning;
  track.heading.restart();
  track.aiding.has_prior = false;
  track.aiding.heading_unproven = heading.heard;
  track.refused = RefusedStreak{};
  track.refused_height = RefusedStreak{};
  if (track.accepted_ns > 0) {
    ++track.reset.counter;
    track.reset.delta = {heading.yaw_map_relative_rad, filter.x.segment<3>(kPosition) - before};
    track.reset_ns = fix.checked.stamp_ns;
  }
}

FixOutcome EkfTracker::filter_fix(EkfTrack& track, const MapFix& fix) const {
  Ekf15& filter = track.filter;
  const auto H = antenna_jacobian(filter.x, lever_base_m_);
  const Vector3d innovation = fix.antenna_map_m - expected_antenna(filter.x, lever_base_m_);
  const Matrix3d S = H * filter.P * H.transpose() + fix.covariance_map_m2;
  for (int i = 0; i < 3; ++i) {
    track.test_ratio[static_cast<std::size_t>(i)] =
        innovation(i) * innovation(i) / (gate1_ * S(i, i));
  }
  const double limit_m =
      config_.highest_speed_mps * std::abs(to_seconds(fix.checked.stamp_ns - track.accepted_ns)) +
      kEkfTeleportMargin_m + 5.0 * std::sqrt(S.diagonal().maxCoeff());
  const double distance2 =
      innovation.head<2>().dot(S.topLeftCorner<2, 2>().ldlt().solve(innovation.head<2>()));
  if (innovation.norm() > limit_m) {
    return refuse(track,
                  fix,
                  "teleport",
                  "it is " + std::to_string(innovation.norm()) +
                      " m from where the filter is, expected at most " + std::to_string(limit_m) +
                      " m.");
  }
  if (!(distance2 <= gate2_)) {
    return refuse(track,
                  fix,
                  "gate",
                  "its squared Mahalanobis distance is " + std::to_string(distance2) +
                      ", expected at most " + std::to_string(gate2_) + " (2 degrees of freedom).");
  }
  FixOutcome outcome{true, "", ""};
  const bool follows = follows_refused(track, innovation);
  Matrix3d R = fix.covariance_map_m2;
  if (innovation.z() * innovation.z() > gate1_ * S(2, 2)) {
    outcome = {true,
               "used_without_height",
               "The fix's height is " + std::to_string(innovation.z()) +
                   " m from the filter's, sigma " + std::to_string(std::sqrt(S(2, 2))) +
                   " m; only its horizontal part is used."};
    ++track.used_without_height;
    R.row(2).setZero();
    R.col(2).setZero();
    R(2, 2) = kIgnoredHeight_m2;
    extend(track.refused_height, fix, config_.highest_speed_mps);
    if (is_believed(track.refused_height, config_.recovery_s)) {
      recover_height(track, fix);
    }
  } else {
    track.refused_height = RefusedStreak{};
  }
  if (follows) {
    readmit(track, fix, outcome.reason.empty());
  } else {
    update_antenna(filter, fix.antenna_map_m, R, lever_base_m_);
  }
  accept(track, fix);
  prove_heading(track, fix);
  return outcome;
}

FixOutcome EkfTracker::refuse(EkfTrack& track,
                              const MapFix& fix,
                              const std::string& reason,
                              const std::string& text) const {
  extend(track.refused, fix, config_.highest_speed_mps);
  track.refused_innovation_m = fix.antenna_map_m - expected_antenna(track.filter.x, lever_base_m_);
  if (is_believed(track.refused, config_.recovery_s)) {
    recover(track, fix);
    return {true,
            "recovered",
            "Fixes that agree with each other were refused for " +
                std::to_string(config_.recovery_s) +
                " s: the position is set to them. Of the last, " + text};
  }
  track.refused_ns = fix.checked.stamp_ns;
  ++(reason == "gate" ? track.refused_gate : track.refused_teleport);
  return {false, reason, "Fix refused: " + text};
}

void EkfTracker::accept(EkfTrack& track, const MapFix& fix) const {
  const double elapsed_s =
      track.accepted_ns > 0 ? to_seconds(fix.checked.stamp_ns - track.accepted_ns) : 0.0;
  hold_correlated(track, fix, elapsed_s);
  hold_reported(track, fix, elapsed_s);
  note_accepted(track, fix);
  if (track.phase == Phase::kRunning) {
    const auto H = antenna_jacobian(track.filter.x, lever_base_m_);
    track.accepted_antenna_map_m = expected_antenna(track.filter.x, lever_base_m_);
    track.accepted_covariance_map_m2 = H * track.filter.P * H.transpose();
  } else {
    track.accepted_antenna_map_m = fix.antenna_map_m;
    track.accepted_covariance_map_m2 = fix.covariance_map_m2;
  }
  track.accepted_covariance_map_m2.diagonal() += added_variance_m2(track);
}

// ---- what is published --------------------------------------------------------------------------

Pose EkfTracker::pose(const EkfTrack& track) const {
  const Vector3d rpy = track.filter.x.segment<3>(kAttitude);
  if (track.phase == Phase::kRunning) {
    return {from_roll_pitch_yaw(rpy), track.filter.x.segment<3>(kPosition)};
  }
  const Eigen::Quaterniond level = from_roll_pitch_yaw({rpy.x(), rpy.y(), 0.0});
  Vector3d position = track.accepted_antenna_map_m;
  position.z() -= (level * lever_base_m_).z();  // which way the rest of the arm points is not known
  return {level, position};
}

PoseCovariance EkfTracker::pose_covariance(const EkfTrack& track) const {
  const Vector3d rpy = track.filter.x.segment<3>(kAttitude);
  // Small rotations about the axes of map from small changes of roll, pitch, yaw.
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Identity();
  J.bottomRightCorner<3, 3>() = track.filter.R_map_base() * body_from_euler_rates(rpy);
  PoseCovariance covariance = J * track.filter.P.topLeftCorner<6, 6>() * J.transpose();
  if (track.phase == Phase::kRunning) {
    covariance.diagonal().head<3>() += added_variance_m2(track);
    return 0.5 * (covariance + covariance.transpose());
  }
  PoseCovariance aligning = PoseCovariance::Zero();
  const double age_s = std::max(0.0, to_seconds(track.stamp_ns - track.accepted_ns));
  const double moved_m = age_s * (track.speed_mps + kEkfAligningSpeedSigma_mps);
  aligning.topLeftCorner<3, 3>() =
      track.accepted_covariance_map_m2 + moved_m * moved_m * Matrix3d::Identity();
  aligning.topLeftCorner<2, 2>() +=
      lever_base_m_.head<2>().squaredNorm() * Eigen::Matrix2d::Identity();
  // Roll and pitch about axes of unknown direction.
  const double tilt = covariance.diagonal().segment<2>(3).maxCoeff();
  aligning.diagonal().tail<3>() << tilt, tilt, kEkfUnknownYaw_rad * kEkfUnknownYaw_rad;
  return aligning;
}

Matrix6d EkfTracker::twist_covariance(const EkfTrack& track) const {
  const Matrix6d covariance = track.filter.P.block<6, 6>(kVelocity, kVelocity);
  return 0.5 * (covariance + covariance.transpose());
}

double EkfTracker::yaw_sigma_rad(const EkfTrack& track) const {
  return track.phase == Phase::kRunning
             ? std::sqrt(std::max(0.0, track.filter.P(kAttitude + 2, kAttitude + 2)))
             : kEkfUnknownYaw_rad;
}

Estimate EkfTracker::estimate(const EkfTrack& track) const {
  Estimate estimate;
  estimate.T_map_base = pose(track);
  estimate.pose_covariance = pose_covariance(track);
  estimate.angular_base_radps = track.filter.x.segment<3>(kRate);
  estimate.twist_covariance = twist_covariance(track);
  if (track.phase == Phase::kRunning) {
    estimate.linear_base_mps = track.filter.x.segment<3>(kVelocity);
  } else {
    forget_velocity(estimate);
  }
  return estimate;
}

bool EkfTracker::is_doubtful(const EkfTrack& track) const {
  return std::abs(track.filter.x(kAttitude + 1)) > kSteep_rad ||
         track.stamp_ns < track.doubt_until_ns;
}

void EkfTracker::change_frame(EkfTrack& track,
                              const Matrix3d& R_new_old,
                              const Vector3d& t_new_old) const {
  const auto move = [&](Vector3d& point) { point = R_new_old * point + t_new_old; };
  if (track.phase == Phase::kRunning) {
    gps_odometry::change_frame(track.filter, R_new_old, t_new_old);
  }
  // While aligning the filter's own heading is free of map: its attitude stays.
  track.heading.change_frame(R_new_old.topLeftCorner<2, 2>(), t_new_old.head<2>());
  move(track.accepted_antenna_map_m);
  track.accepted_covariance_map_m2 =
      R_new_old * track.accepted_covariance_map_m2 * R_new_old.transpose();
  move(track.refused.last_map_m);
  move(track.refused_height.last_map_m);
  track.aiding.prior_yaw_map_relative_rad += std::atan2(R_new_old(1, 0), R_new_old(0, 0));
}

}  // namespace trigpoint::gps_odometry
