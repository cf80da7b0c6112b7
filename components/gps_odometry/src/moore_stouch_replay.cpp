// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "moore_stouch_replay.hpp"

#include "trigpoint/base/so3.hpp"

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

MeasuredStates chosen(const MeasuredStates& measured, int first, int count) {
  MeasuredStates block;
  for (int i = first; i < first + count; ++i) {
    const auto bit = static_cast<std::size_t>(i);
    block[bit] = measured[bit];
  }
  return block;
}

/// The axes of base_link that get anything from the chosen axes of the IMU.
MeasuredStates turned(const MeasuredStates& measured, int first, const Matrix3d& R_base_imu) {
  constexpr double kNothing = 1e-6;
  Vector3d axes_imu;
  for (int i = 0; i < 3; ++i) {
    axes_imu(i) = measured[static_cast<std::size_t>(first + i)] ? 1.0 : 0.0;
  }
  MeasuredStates block;
  for (int i = 0; i < 3; ++i) {
    block[static_cast<std::size_t>(first + i)] =
        R_base_imu.row(i).transpose().cwiseProduct(axes_imu).norm() >= kNothing;
  }
  return block;
}

}  // namespace

MooreStouchReplay::MooreStouchReplay(const MooreStouch& start, double sensor_timeout_s)
    : filter_(start), sensor_timeout_s_(sensor_timeout_s) {}

void MooreStouchReplay::add(const AhrsSample& sample, const ImuUse& use) {
  const Matrix3d R_base_imu = use.T_base_imu.linear();
  if (sample.q_world_imu) {
    Measurement attitude;
    const Eigen::Quaterniond q_imu_base(R_base_imu.transpose());
    attitude.z.segment<3>(kAttitude) = roll_pitch_yaw_of(*sample.q_world_imu * q_imu_base);
    attitude.R.block<3, 3>(kAttitude, kAttitude) = sample.attitude_covariance_rad2;
    attitude.measured = chosen(use.measured, kAttitude, 3);
    enqueue(Kind::kAttitude, sample.stamp_ns, attitude);
  }
  Measurement rate;
  rate.z.segment<3>(kRate) = R_base_imu * sample.gyro_radps;
  rate.R.block<3, 3>(kRate, kRate) = R_base_imu * sample.gyro_covariance * R_base_imu.transpose();
  rate.measured = turned(use.measured, kRate, R_base_imu);
  enqueue(Kind::kRate, sample.stamp_ns, rate);

  Measurement acceleration;
  acceleration.z.segment<3>(kAcceleration) = acceleration_base(sample, use);
  acceleration.R.block<3, 3>(kAcceleration, kAcceleration) =
      R_base_imu * sample.accel_covariance * R_base_imu.transpose();
  acceleration.measured = turned(use.measured, kAcceleration, R_base_imu);
  enqueue(Kind::kAcceleration, sample.stamp_ns, acceleration);
}

/// Without gravity as the message's attitude sees it (the filter's, where the message has none),
/// and moved from the IMU to base_link: a_base = a_imu - dw/dt x r - w x (w x r), w and dw/dt being
/// the state's.
Vector3d MooreStouchReplay::acceleration_base(const AhrsSample& sample, const ImuUse& use) const {
  const Eigen::Quaterniond q_base_imu(use.T_base_imu.linear());
  const Eigen::Quaterniond q_world_imu = sample.q_world_imu.value_or(
      from_roll_pitch_yaw(filter_.x.segment<3>(kAttitude)) * q_base_imu);
  const Vector3d gravity_imu = q_world_imu.conjugate() * Vector3d(0.0, 0.0, kGravity_mps2);
  const Vector3d at_imu = q_base_imu * (sample.accel_mps2 - gravity_imu);
  const Vector3d r = use.T_base_imu.translation();
  const Vector3d w = filter_.x.segment<3>(kRate);
  return at_imu - rate_change_radps2_.cross(r) - w.cross(w.cross(r));
}

void MooreStouchReplay::add(const TwistSample& sample, const MeasuredStates& measured) {
  Measurement twist;
  twist.z.segment<6>(kVelocity) = sample.twist_base;
  twist.R.block<6, 6>(kVelocity, kVelocity) = sample.covariance;
  twist.measured = chosen(measured, kVelocity, 6);
  enqueue(Kind::kTwist, sample.stamp_ns, twist);
}

void MooreStouchReplay::add(const PositionSample& sample) {
  Measurement position;
  position.z.segment<3>(kPosition) = sample.position_m;
  position.R.block<3, 3>(kPosition, kPosition) = sample.covariance_m2;
  position.measured = MeasuredStates{0b111} << kPosition;
  enqueue(Kind::kPosition, sample.stamp_ns, position);
}

void MooreStouchReplay::enqueue(Kind kind, Nanoseconds stamp_ns, const Measurement& measurement) {
  if (measurement.measured.none()) {
    return;
  }
  const auto [newest, first] = newest_ns_.try_emplace(kind, stamp_ns);
  if (!first && stamp_ns < newest->second) {
    return;
  }
  newest->second = stamp_ns;
  queue_.emplace(stamp_ns, measurement);
}

void MooreStouchReplay::predict_to(Nanoseconds stamp_ns) {
  filter_.predict(to_seconds(stamp_ns - filter_ns_));
  filter_ns_ = stamp_ns;
}

void MooreStouchReplay::fuse(Nanoseconds stamp_ns, const Measurement& measurement) {
  if (!filter_.initialised) {
    filter_ns_ = stamp_ns;
  } else if (stamp_ns > filter_ns_) {
    predict_to(stamp_ns);
  } else if (stamp_ns < filter_ns_) {
    ++late_measurements_;
  }
  filter_.correct(measurement.z, measurement.R, measurement.measured);
}

void MooreStouchReplay::tick(Nanoseconds now_ns) {
  if (!queue_.empty()) {
    const auto end = queue_.upper_bound(now_ns);
    for (auto next = queue_.begin(); next != end; ++next) {
      fuse(next->first, next->second);
    }
    queue_.erase(queue_.begin(), end);
    last_input_ns_ = now_ns;
  } else if (filter_.initialised && now_ns > filter_ns_ &&
             to_seconds(now_ns - last_input_ns_) >= sensor_timeout_s_) {
    predict_to(now_ns);
  }
  if (last_tick_ns_ && now_ns > *last_tick_ns_) {
    rate_change_radps2_ =
        (filter_.x.segment<3>(kRate) - last_rate_radps_) / to_seconds(now_ns - *last_tick_ns_);
  }
  last_rate_radps_ = filter_.x.segment<3>(kRate);
  last_tick_ns_ = now_ns;
}

}  // namespace trigpoint::gps_odometry
