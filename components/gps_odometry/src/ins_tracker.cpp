// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ins_tracker.hpp"

#include "trigpoint/base/so3.hpp"

#include "chi_square.hpp"
#include "gravity.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kTiltSigma_rad = 0.15;  // of a first levelling in motion
constexpr double kShortGap_s = 0.1;      // IMU gap from which on motion in it is unknown
constexpr double kLongGap_s = 1.0;       // after which attitude and velocity are doubted
constexpr double kRestartGap_s = 5.0;    // after which nothing is left
constexpr double kGapRate_radps = 0.3;   // unknown motion in a gap
constexpr double kGapAccel_mps2 = 2.0;
constexpr double kSaturatedGyro_radps_sqrthz = 0.3;  // some rad/s and g for a hundredth of a second
constexpr double kSaturatedAccel_mps2_sqrthz = 5.0;
constexpr double kLevelSigma_mps2 = 2.0;  // manoeuvres while nothing but gravity levels
constexpr double kSlowDecay = 1e6;        // an absorbed jump stays
// Rest, research/gps C5; each is widened by what the filter knows.
constexpr double kRestRate_radps = 0.01;
constexpr double kRestForce_mps2 = 0.3;
constexpr double kRestForceError_mps2 = 0.15;
/// Of fixes that tell motion from rest: how far apart for a metre of sigma, within limits; how fast
/// those of a receiver at rest wander, and by how much they scatter.
constexpr double kTrailPerSigma_spm = 8.0;
constexpr double kShortestTrail_s = 1.0;
constexpr double kLongestTrail_s = 10.0;
constexpr double kWander_mps = 0.1;
constexpr double kScatter_sigmas = 4.0;
constexpr double kRestSpeed_mps = 0.05;
constexpr double kAligningSpeedSigma_mps = 1.0;
constexpr double kUnknownYaw_rad = std::numbers::pi;

}  // namespace

InsTracker::InsTracker(const Config& config, const Vector3d& lever_base_m)
    : config_(config),
      lever_base_m_(lever_base_m),
      gate_{chi_square_limit_2(config.gate_probability),
            chi_square_limit_1(config.gate_probability)},
      gate_axis_(chi_square_limit_1(config.gate_probability)),
      gate3_(chi_square_limit_3(config.gate_probability)) {}

// ---- IMU ----------------------------------------------------------------------------------------

void InsTracker::start(InsTrack& track, const CheckedImu& imu) const {
  const Eskf18Config& c = config_.eskf18;
  track.phase = Phase::kAligning;
  track.warm_ns = 0;
  track.has_rival = false;
  track.filter = Eskf18{};
  // Level: the mean specific force is up. Heading stays open: 0 in a frame of its own.
  const Eigen::Quaterniond level = rotation_between(imu.mean_accel_mps2, Vector3d::UnitZ());
  track.filter.q_map_base = from_yaw(-yaw_of(level)) * level;
  const double unknown_speed = 0.5 * config_.highest_speed_mps;
  Vector18d sigma;
  sigma << 1.0, 1.0, 1.0, unknown_speed, unknown_speed, 1.0, kTiltSigma_rad, kTiltSigma_rad, 1e-3,
      Vector3d::Constant(c.gyro_bias_sigma_radps), Vector3d::Constant(c.accel_bias_sigma_mps2),
      Vector3d::Ones();
  track.filter.P = sigma.cwiseAbs2().asDiagonal();
  track.heading.restart();
  track.aiding = AidingState{};
  // The IMU's clock may have moved: what was stamped before says nothing any more.
  track.no_side_slip_ns = track.doubt_until_ns = track.saturated_ns = track.quiet_ns = 0;
  track.heard_ns = track.accepted_ns;
  track.parts = {};
  track.lately = {};
  track.doubt_m.setZero();
}

void InsTracker::warm_start(InsTrack& track, const WarmState& state) const {
  Eskf18& filter = track.filter;
  filter.p_map_m = state.T_map_base.p;
  filter.q_map_base = state.T_map_base.q;
  filter.v_map_mps = state.T_map_base.q * state.linear_base_mps;
  const Matrix3d R = filter.R_map_base();
  const Matrix3d rotation = R.transpose() * state.rotation_covariance_rad2 * R;
  // v_map = R v_base: a wrong heading turns the velocity with it, and no wheel sees that.
  const Matrix3d J = -R * hat(state.linear_base_mps);
  reset_block(filter, ins::kPosition, state.position_covariance_m2);
  reset_block(filter, ins::kRotation, rotation);
  reset_block(filter,
              ins::kVelocity,
              R * state.velocity_covariance_m2ps2 * R.transpose() + J * rotation * J.transpose());
  filter.P.block<3, 3>(ins::kVelocity, ins::kRotation) = J * rotation;
  filter.P.block<3, 3>(ins::kRotation, ins::kVelocity) = (J * rotation).transpose();
  track.phase = Phase::kRunning;
  track.warm_ns = track.stamp_ns;
}

InsNoise InsTracker::noise(const InsTrack& track) const {
  const Eskf18Config& c = config_.eskf18;
  InsNoise noise;
  noise.gyro_radps_sqrthz = c.gyro_noise_radps_sqrthz;
  noise.accel_mps2_sqrthz = c.accel_noise_mps2_sqrthz;
  noise.gyro_bias_radps_sqrts = c.gyro_bias_walk_radps_sqrts;
  noise.accel_bias_mps2_sqrts = c.accel_bias_walk_mps2_sqrts;
  noise.fix_error_sigma_m = (c.fix_slow_share * track.fix_variance_m2).cwiseSqrt();
  noise.fix_error_tau_s = track.gnss_class == GnssClass::kFixed   ? c.fix_tau_fixed_s
                          : track.gnss_class == GnssClass::kFloat ? c.fix_tau_float_s
                                                                  : c.fix_tau_code_s;
  if (std::any_of(track.parts.begin(), track.parts.end(), [](const Contradiction& part) {
        return part.absorbed_ns > 0;
      })) {
    // The same noise, but the jump stays.
    noise.fix_error_tau_s *= kSlowDecay;
    noise.fix_error_sigma_m *= std::sqrt(kSlowDecay);
  }
  return noise;
}

void InsTracker::advance(InsTrack& track, Nanoseconds stamp_ns) const {
  const InsNoise n = noise(track);
  const double duration_s = to_seconds(stamp_ns - track.stamp_ns);
  for_each(track, [&](Eskf18& filter) {
    predict(filter, track.imu, duration_s, config_.longest_step_s, n);
  });
  track.stamp_ns = std::max(track.stamp_ns, stamp_ns);
}

/// Trapezoid rule from the last sample to this one. Where a fix came in between, the first piece
/// was predicted with the last sample held; the rest makes up for that, so that angle and velocity
/// of the whole are the trapezoid's.
void InsTracker::step(InsTrack& track, const CheckedImu& imu, double gap_s, bool saturated) const {
  const double held_s = to_seconds(track.stamp_ns - track.imu_ns);
  const double rest_s = to_seconds(imu.stamp_ns - track.stamp_ns);
  if (!(rest_s > 0.0)) {
    return;
  }
  const auto mean = [&](const Vector3d& last, const Vector3d& now) -> Vector3d {
    return (0.5 * gap_s * (last + now) - held_s * last) / rest_s;
  };
  const ImuMean between{mean(track.imu.gyro_radps, imu.raw_gyro_radps),
                        mean(track.imu.accel_mps2, imu.accel_mps2)};
  InsNoise n = noise(track);
  if (gap_s > kShortGap_s) {
    n.gyro_radps_sqrthz = std::hypot(n.gyro_radps_sqrthz, kGapRate_radps * std::sqrt(gap_s));
    n.accel_mps2_sqrthz = std::hypot(n.accel_mps2_sqrthz, kGapAccel_mps2 * std::sqrt(gap_s));
  }
  if (saturated || track.saturated_ns == track.imu_ns) {
    n.gyro_radps_sqrthz = std::hypot(n.gyro_radps_sqrthz, kSaturatedGyro_radps_sqrthz);
    n.accel_mps2_sqrthz = std::hypot(n.accel_mps2_sqrthz, kSaturatedAccel_mps2_sqrthz);
  }
  for_each(track,
           [&](Eskf18& filter) { predict(filter, between, rest_s, config_.longest_step_s, n); });
}

void InsTracker::apply(InsTrack& track, const CheckedImu& imu) const {
  const double gap_s = to_seconds(imu.stamp_ns - track.imu_ns);
  const bool saturated = is_saturated(imu, config_);
  if (track.phase == Phase::kNoImu || gap_s > kRestartGap_s) {
    start(track, imu);
  } else {
    step(track, imu, gap_s, saturated);
  }
  track.stamp_ns = std::max(track.stamp_ns, imu.stamp_ns);
  track.imu_ns = imu.stamp_ns;
  track.imu = {imu.raw_gyro_radps, imu.accel_mps2};
  track.quiet_ns = imu.quiet ? imu.stamp_ns : track.quiet_ns;
  track.saturated_ns = saturated ? imu.stamp_ns : track.saturated_ns;
  if (gap_s > kLongGap_s && gap_s <= kRestartGap_s) {
    for_each(track, [&](Eskf18& filter) {
      reset_block(filter, ins::kVelocity, Matrix3d::Identity() * 9.0);
      doubt_rotation(filter, Vector3d::Constant(kTiltSigma_rad * std::sqrt(gap_s)));
    });
  } else if (gap_s <= kShortGap_s) {
    constrain(track, imu);
  }
}

/// Whether the receiver has gone farther, by fixes that are as many seconds apart as their sigmas
/// ask for, than fixes of one at rest scatter and wander.
void InsTracker::watch_motion(InsTrack& track, const MapFix& fix) const {
  const TrailPoint now{fix.checked.stamp_ns,
                       fix.antenna_map_m,
                       fix.covariance_map_m2.diagonal().head<2>().maxCoeff()};
  auto& [older, newer] = track.trail;
  const double apart_s = std::clamp(
      kTrailPerSigma_spm * std::sqrt(now.variance_m2), kShortestTrail_s, kLongestTrail_s);
  if (newer.stamp_ns == 0) {
    newer = now;
  } else if (to_seconds(now.stamp_ns - newer.stamp_ns) >= apart_s) {
    older = newer;
    newer = now;
  }
  const double passed_s = to_seconds(now.stamp_ns - older.stamp_ns);
  if (older.stamp_ns == 0 || passed_s <= 0.0) {
    return;
  }
  const double moved_m = (now.antenna_map_m - older.antenna_map_m).head<2>().norm();
  const double at_rest_m =
      kWander_mps * passed_s + kScatter_sigmas * std::sqrt(now.variance_m2 + older.variance_m2);
  if (moved_m > at_rest_m) {
    track.moves_until_ns = now.stamp_ns + from_seconds(kShortestTrail_s);
  }
}

/// An IMU on a smooth floor is as quiet at a steady speed as at rest: fixes that move tell.
bool InsTracker::is_at_rest(const InsTrack& track, const QuietWindow& quiet) const {
  if (track.imu_ns < track.moves_until_ns) {
    return false;
  }
  const Eskf18& filter = track.filter;
  const auto sigma = [&](int first) {
    return std::sqrt(filter.P.diagonal().segment<3>(first).maxCoeff());
  };
  const double rate = (quiet.mean_gyro_radps - filter.gyro_bias_radps).norm();
  const Jacobian3 H = force_at_rest_jacobian(filter);
  const Matrix3d S_force = H * filter.P * H.transpose();
  const double force = (quiet.mean_accel_mps2 - force_at_rest(filter)).norm();
  double speed = filter.v_map_mps.norm();
  double allowed =
      std::min(kRestSpeed_mps + 4.0 * sigma(ins::kVelocity), config_.eskf18.rest_highest_speed_mps);
  if (track.phase == Phase::kAligning) {
    // By the fixes, which is little where they are coarse.
    const double interval_s = std::max(track.fix_interval_s, 0.1);
    speed = track.speed_mps;
    allowed = config_.eskf18.rest_highest_speed_mps +
              3.0 * std::sqrt(2.0 * track.fix_variance_m2.head<2>().sum()) / interval_s;
  }
  return speed < allowed && rate < kRestRate_radps + 4.0 * sigma(ins::kGyroBias) &&
         std::abs(quiet.mean_accel_mps2.norm() - kGravity_mps2) < kRestForce_mps2 &&
         force < kRestForceError_mps2 + 4.0 * std::sqrt(S_force.diagonal().maxCoeff());
}

/// What the vehicle does not do: move at rest, slide sideways, fly.
void InsTracker::constrain(InsTrack& track, const CheckedImu& imu) const {
  const Eskf18Config& c = config_.eskf18;
  if (c.use_rest && imu.quiet && is_at_rest(track, *imu.quiet)) {
    const double gyro_sigma = std::max(imu.quiet->gyro_sigma_radps, c.rest_gyro_sigma_radps);
    for_each(track, [&](Eskf18& filter) {
      update_at_rest(filter, c.rest_velocity_sigma_mps, imu.quiet->mean_gyro_radps, gyro_sigma);
    });
  }
  if (to_seconds(imu.stamp_ns - track.no_side_slip_ns) < c.no_side_slip_interval_s) {
    return;
  }
  if (track.phase == Phase::kAligning) {
    track.no_side_slip_ns = imu.stamp_ns;
    update_level(track.filter, imu.accel_mps2, kLevelSigma_mps2);
    return;
  }
  const double speed = track.filter.v_map_mps.norm();
  if (c.no_side_slip && !track.aiding.heading_unproven && speed > c.no_side_slip_speed_mps &&
      filter_yaw_sigma_rad(track) < c.no_side_slip_yaw_sigma_rad) {
    track.no_side_slip_ns = imu.stamp_ns;
    const double sigma = std::hypot(c.no_side_slip_sigma_mps, c.no_side_slip_share * speed);
    for_each(track, [&](Eskf18& filter) {
      update_no_side_slip(filter, sigma, c.no_side_slip_point_base_m, imu.raw_gyro_radps);
    });
  }
}

bool InsTracker::bridges(double gap_s) const {
  return gap_s <= kRestartGap_s;
}

// ---- what is published --------------------------------------------------------------------------

Vector3d InsTracker::doubt_variance_m2(const InsTrack& track) const {
  const double since_s = std::max(0.0, to_seconds(track.stamp_ns - track.doubt_until_ns));
  return std::exp(-2.0 * since_s / config_.eskf18.doubt_decay_s) * track.doubt_m.cwiseAbs2();
}

/// Floors, peak hold and doubt.
Vector3d InsTracker::added_variance_m2(const InsTrack& track) const {
  return floor_variance_m2(track, config_) + doubt_variance_m2(track) +
         (track.held_variance_m2 - track.fix_variance_m2).cwiseMax(0.0);
}

Estimate InsTracker::aligning_estimate(const InsTrack& track) const {
  const Eskf18& filter = track.filter;
  Estimate estimate;
  const Vector3d rpy = roll_pitch_yaw_of(filter.q_map_base);
  const Eigen::Quaterniond level = from_roll_pitch_yaw({rpy.x(), rpy.y(), 0.0});
  Vector3d position = track.accepted_antenna_map_m;
  position.z() -= (level * lever_base_m_).z();  // which way the rest of the arm points is not known
  estimate.T_map_base = {level, position};
  const double age_s = std::max(0.0, to_seconds(track.stamp_ns - track.accepted_ns));
  const double moved_m = age_s * (track.speed_mps + kAligningSpeedSigma_mps);
  PoseCovariance& P = estimate.pose_covariance;
  P.setZero();
  P.topLeftCorner<3, 3>() =
      track.accepted_covariance_map_m2 + moved_m * moved_m * Matrix3d::Identity();
  P.topLeftCorner<2, 2>() += lever_base_m_.head<2>().squaredNorm() * Eigen::Matrix2d::Identity();
  const double tilt = filter.P.diagonal().segment<2>(ins::kRotation).maxCoeff();
  P.diagonal().tail<3>() << tilt, tilt, kUnknownYaw_rad * kUnknownYaw_rad;
  return estimate;
}

Estimate InsTracker::estimate(const InsTrack& track) const {
  const Eskf18& filter = track.filter;
  const bool running = track.phase == Phase::kRunning;
  Estimate estimate = running ? Estimate{} : aligning_estimate(track);
  if (running) {
    estimate.T_map_base = {filter.q_map_base, filter.p_map_m};
    // Rotation errors about the axes of map.
    Eigen::Matrix<double, 6, 18> J = Eigen::Matrix<double, 6, 18>::Zero();
    J.block<3, 3>(0, ins::kPosition).setIdentity();
    J.block<3, 3>(3, ins::kRotation) = filter.R_map_base();
    PoseCovariance& P = estimate.pose_covariance;
    P = J * filter.P * J.transpose();
    P.diagonal().head<3>() += added_variance_m2(track);
    // Two headings: the mixture's second moment about the one that is published.
    const double share = rival_share(track);
    const Vector3d apart = track.rival.p_map_m - filter.p_map_m;
    if (share > 0.0) {
      P.topLeftCorner<3, 3>() += share * apart * apart.transpose();
      P(5, 5) += share * kUnknownYaw_rad * kUnknownYaw_rad;
    }
    P = (0.5 * (P + P.transpose())).eval();
  }
  const double gyro_noise = config_.gyro_sigma_radps * config_.gyro_sigma_radps;
  Eigen::Matrix<double, 6, 18> J = Eigen::Matrix<double, 6, 18>::Zero();
  J.topRows<3>() = body_velocity_jacobian(filter, Vector3d::Zero());
  J.block<3, 3>(3, ins::kGyroBias) = -Matrix3d::Identity();
  estimate.twist_covariance = J * filter.P * J.transpose();
  estimate.twist_covariance.diagonal().tail<3>().array() += gyro_noise;
  estimate.twist_covariance =
      (0.5 * (estimate.twist_covariance + estimate.twist_covariance.transpose())).eval();
  estimate.angular_base_radps = track.imu.gyro_radps - filter.gyro_bias_radps;
  estimate.linear_base_mps = filter.q_map_base.conjugate() * filter.v_map_mps;
  if (!running) {
    estimate.linear_base_mps.setZero();
    forget_velocity(estimate);
  }
  return estimate;
}

double InsTracker::filter_yaw_sigma_rad(const InsTrack& track) const {
  const Jacobian1 H = yaw_jacobian(track.filter);
  return std::sqrt(std::max(0.0, (H * track.filter.P * H.transpose()).value()));
}

double InsTracker::rival_share(const InsTrack& track) const {
  return track.has_rival ? 1.0 / (1.0 + std::exp(track.log_ratio)) : 0.0;
}

double InsTracker::yaw_sigma_rad(const InsTrack& track) const {
  if (track.phase != Phase::kRunning) {
    return kUnknownYaw_rad;
  }
  return std::hypot(filter_yaw_sigma_rad(track), std::sqrt(rival_share(track)) * kUnknownYaw_rad);
}

bool InsTracker::is_doubtful(const InsTrack& track) const {
  return track.stamp_ns < track.doubt_until_ns ||
         std::any_of(track.parts.begin(), track.parts.end(), [](const Contradiction& part) {
           return part.absorbed_ns > 0;
         });
}

void InsTracker::change_frame(InsTrack& track,
                              const Matrix3d& R_new_old,
                              const Vector3d& t_new_old) const {
  const auto move = [&](Vector3d& point) { point = R_new_old * point + t_new_old; };
  if (track.phase == Phase::kRunning) {
    for_each(track,
             [&](Eskf18& filter) { gps_odometry::change_frame(filter, R_new_old, t_new_old); });
  }
  // While aligning the filter's own heading is free of map: its attitude stays.
  track.heading.change_frame(R_new_old.topLeftCorner<2, 2>(), t_new_old.head<2>());
  move(track.accepted_antenna_map_m);
  track.accepted_covariance_map_m2 =
      R_new_old * track.accepted_covariance_map_m2 * R_new_old.transpose();
  move(track.refused.last_map_m);
  track.aiding.prior_yaw_map_relative_rad += std::atan2(R_new_old(1, 0), R_new_old(0, 0));
  for (Contradiction& part : track.parts) {
    move(part.streak.last_map_m);
    move(part.steady_fix_map_m);
    part.steady_off_m = R_new_old * part.steady_off_m;
  }
  for (FixOnTheWay& point : track.lately) {
    move(point.fix_map_m);
    move(point.antenna_map_m);
    point.way_m = R_new_old * point.way_m;
  }
  for (TrailPoint& point : track.trail) {
    move(point.antenna_map_m);
  }
}

}  // namespace trigpoint::gps_odometry
