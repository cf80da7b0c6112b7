// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "strict_filter.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kAttitudeSigma_rad = 0.035;
constexpr double kLevelTau_s = 5.0;
constexpr double kLongestLevelStep_s = 0.1;

/// Roll, pitch, rates, accelerations: what is commonly chosen for an IMU without magnetometer.
MeasuredStates of_imu() {
  MeasuredStates measured;
  for (std::size_t i = 0; i < 3; ++i) {
    measured.set(kAttitude + i, i < 2);
    measured.set(kRate + i);
    measured.set(kAcceleration + i);
  }
  return measured;
}

Matrix3d variance(double sigma) {
  return Matrix3d::Identity() * sigma * sigma;
}

}  // namespace

StrictSettings published_settings() {
  return {"ekf15_strict", 30.0, published_process_noise(), false};
}

StrictSettings lio_sam_settings() {
  Vector15d q;
  q << 1.0, 1.0, 10.0,    // position, m^2/s
      0.03, 0.03, 0.1,    // attitude, rad^2/s
      0.25, 0.25, 0.04,   // velocity, (m/s)^2/s
      0.01, 0.01, 0.5,    // rates, (rad/s)^2/s
      0.01, 0.01, 0.015;  // acceleration, (m/s^2)^2/s
  return {"ekf15_lio_sam", 50.0, q, true};
}

StrictFilter::StrictFilter(const Config& config,
                           const RobotConfig& robot,
                           const StrictSettings& settings)
    : config_(config),
      settings_(settings),
      lever_base_m_(robot.antenna_position_base_m),
      start_tracker_(config, lever_base_m_),
      replay_(MooreStouch{}, tick_s()) {
  start_.emplace(start_tracker_, from_seconds(config.rewind_s));
}

void StrictFilter::follow_start() {
  track_ = start_->newest();
  track_.accepted += before_start_.accepted;
  track_.refused_gate += before_start_.refused_gate;
  track_.refused_teleport += before_start_.refused_teleport;
  track_.refused_before_imu += before_start_.refused_before_imu;
  track_.used_without_height += before_start_.used_without_height;
  track_.recoveries += before_start_.recoveries;
  track_.not_finite += before_start_.not_finite;
  track_.reset.counter += before_start_.reset.counter;
  if (is_running()) {
    begin();
  }
}

/// The first measurement is copied, as published; what it does not measure is as found.
void StrictFilter::begin() {
  MooreStouch seed;
  seed.x = start_->newest().filter.x;
  seed.P = start_->newest().filter.P;
  seed.process_noise_per_s = settings_.process_noise_per_s;
  replay_ = MooreStouchReplay(seed, tick_s());
  up_base_ = from_roll_pitch_yaw(seed.x.segment<3>(kAttitude)).conjugate() * Vector3d::UnitZ();
}

/// Stands for the attitude that the published filter takes from elsewhere: up' = -w x up, drawn to
/// the specific force with a time constant. Its heading is the filter's own, and not measured.
Eigen::Quaterniond StrictFilter::level(const CheckedImu& imu) {
  const double dt_s = std::clamp(to_seconds(imu.stamp_ns - *imu_ns_), 0.0, kLongestLevelStep_s);
  up_base_ -= dt_s * imu.gyro_radps.cross(up_base_);
  if (const double f = imu.accel_mps2.norm(); f > 0.0) {
    up_base_ += dt_s / kLevelTau_s * (imu.accel_mps2 / f - up_base_);
  }
  up_base_.normalize();
  const Eigen::Quaterniond tilt = rotation_between(up_base_, Vector3d::UnitZ());
  return from_yaw(x()(kAttitude + 2) - yaw_of(tilt)) * tilt;
}

void StrictFilter::insert(const CheckedImu& imu) {
  if (!is_running()) {
    imu_ns_ = imu.stamp_ns;
    start_->insert(imu);
    follow_start();
    return;
  }
  AhrsSample sample;
  sample.stamp_ns = imu.stamp_ns;
  sample.q_world_imu = level(imu);
  sample.attitude_covariance_rad2 = variance(kAttitudeSigma_rad);
  sample.gyro_radps = imu.gyro_radps;
  sample.gyro_covariance = variance(config_.gyro_sigma_radps);
  sample.accel_mps2 = imu.accel_mps2;
  sample.accel_covariance = variance(config_.accel_sigma_mps2);
  replay_.add(sample, {Eigen::Isometry3d::Identity(), of_imu()});
  imu_ns_ = track_.imu_ns = imu.stamp_ns;
  if (to_seconds(imu.stamp_ns - tick_ns_) >= tick_s()) {
    tick(imu.stamp_ns);
  }
}

FixOutcome StrictFilter::insert(const MapFix& fix) {
  if (!is_running()) {
    const FixOutcome outcome = start_->insert(fix);
    follow_start();
    return outcome;
  }
  const Matrix3d R = from_roll_pitch_yaw(x().segment<3>(kAttitude)).toRotationMatrix();
  // As reported: the scale is a correction of ours.
  const double scale = fix.checked.assumed_covariance ? 1.0 : config_.fix_sigma_scale;
  const Matrix3d reported = fix.covariance_map_m2 / (scale * scale);
  Vector3d position_m = fix.antenna_map_m - R * lever_base_m_;
  if (settings_.zero_altitude) {
    position_m.z() = 0.0;
  }
  replay_.add(PositionSample{fix.checked.stamp_ns, position_m, reported});
  tick(std::max(*imu_ns_, fix.checked.stamp_ns));
  note_accepted(track_, fix);
  track_.accepted_antenna_map_m =
      x().segment<3>(kPosition) + from_roll_pitch_yaw(x().segment<3>(kAttitude)) * lever_base_m_;
  track_.accepted_covariance_map_m2 = P().block<3, 3>(kPosition, kPosition);
  return {true, "", ""};
}

FixOutcome StrictFilter::insert(const CheckedTwist&) {
  return {false, "twist_not_an_input", "Refused: the published filter has no such input here."};
}

FixOutcome StrictFilter::insert(const Heading&) {
  return {false, "yaw_not_an_input", "Refused: the published filter has no such input here."};
}

void StrictFilter::tick(Nanoseconds now_ns) {
  replay_.tick(now_ns);
  tick_ns_ = now_ns;
  track_.stamp_ns = std::max(track_.stamp_ns, replay_.stamp_ns());
  if (!x().allFinite() || !P().allFinite()) {
    ++track_.not_finite;
    restart();
  }
}

bool StrictFilter::is_too_old(Nanoseconds stamp_ns) const {
  return is_running()
             ? stamp_ns < track_.accepted_ns || stamp_ns < *imu_ns_ - from_seconds(config_.rewind_s)
             : start_->is_too_old(stamp_ns);
}

bool StrictFilter::has_fix_at(Nanoseconds stamp_ns) const {
  return is_running() ? stamp_ns == track_.accepted_ns : start_->has_fix_at(stamp_ns);
}

std::vector<FixRecord> StrictFilter::recent_fixes() const {
  return is_running() ? std::vector<FixRecord>{} : start_->fixes();
}

std::optional<Nanoseconds> StrictFilter::newest_imu_ns() const {
  return imu_ns_;
}

bool StrictFilter::bridges_gap_until(Nanoseconds stamp_ns) const {
  return is_running() && stamp_ns > *imu_ns_;
}

void StrictFilter::restart() {
  before_start_ = track_;
  ++before_start_.reset.counter;
  start_.emplace(start_tracker_, from_seconds(config_.rewind_s));
  imu_ns_.reset();
  follow_start();
}

void StrictFilter::change_frame(const Matrix3d& R_new_old, const Vector3d& t_new_old) {
  if (!is_running()) {
    start_->change_frame(R_new_old, t_new_old);
    follow_start();
    return;
  }
  Ekf15 moved{x(), P()};
  gps_odometry::change_frame(moved, R_new_old, t_new_old);
  replay_.filter().x = moved.x;
  replay_.filter().P = moved.P;
  track_.accepted_antenna_map_m = R_new_old * track_.accepted_antenna_map_m + t_new_old;
  track_.accepted_covariance_map_m2 =
      R_new_old * track_.accepted_covariance_map_m2 * R_new_old.transpose();
}

void StrictFilter::announce_reset(const YawPose& delta) {
  start_->announce_reset(delta);
  ++track_.reset.counter;
  track_.reset.delta = delta;
  track_.reset_ns = track_.stamp_ns;
}

Estimate StrictFilter::estimate() const {
  if (!is_running()) {
    return start_tracker_.estimate(start_->newest());
  }
  const Vector3d rpy = x().segment<3>(kAttitude);
  Estimate estimate;
  estimate.T_map_base = {from_roll_pitch_yaw(rpy), x().segment<3>(kPosition)};
  // Small rotations about the axes of map from small changes of roll, pitch, yaw.
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() =
      estimate.T_map_base.q.toRotationMatrix() * body_from_euler_rates(rpy);
  const Matrix6d pose = J * P().topLeftCorner<6, 6>() * J.transpose();
  estimate.pose_covariance = 0.5 * (pose + pose.transpose());
  estimate.linear_base_mps = x().segment<3>(kVelocity);
  estimate.angular_base_radps = x().segment<3>(kRate);
  const Matrix6d twist = P().block<6, 6>(kVelocity, kVelocity);
  estimate.twist_covariance = 0.5 * (twist + twist.transpose());
  return estimate;
}

double StrictFilter::speed_mps() const {
  return is_running() ? x().segment<3>(kVelocity).norm()
                      : start_tracker_.speed_mps(start_->newest());
}

double StrictFilter::yaw_sigma_rad() const {
  return is_running() ? std::sqrt(std::max(0.0, P()(kAttitude + 2, kAttitude + 2)))
                      : start_tracker_.yaw_sigma_rad(start_->newest());
}

}  // namespace trigpoint::gps_odometry
