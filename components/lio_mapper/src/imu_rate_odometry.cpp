// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_rate_odometry.hpp"

#include <algorithm>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;

namespace {

constexpr double kLongestImuRateStep_s = 0.02;

Matrix6d in_ros_order(const State& state, const ErrorMatrix& covariance) {
  Matrix6d to_odom = Matrix6d::Identity();
  to_odom.bottomRightCorner<3, 3>() = state.T_odom_base.q.toRotationMatrix();
  return to_odom * covariance.topLeftCorner<6, 6>() * to_odom.transpose();
}

}  // namespace

Odometry odometry_of(const State& state,
                     const ErrorMatrix& covariance,
                     const Matrix6d& pose_covariance,
                     const Eigen::Vector3d& gyro_radps,
                     const ImuConfig& imu,
                     Nanoseconds stamp_ns) {
  Odometry odometry;
  odometry.stamp_ns = stamp_ns;
  odometry.frame_id = "odom";
  odometry.child_frame_id = "base_link";
  odometry.T_frame_child = state.T_odom_base;
  odometry.pose_covariance = pose_covariance;
  const Matrix3d R_base_odom = state.T_odom_base.q.conjugate().toRotationMatrix();
  odometry.linear_mps = R_base_odom * state.v_odom_mps;
  odometry.angular_radps = gyro_radps - state.gyro_bias_radps;
  odometry.twist_covariance.setZero();
  odometry.twist_covariance.topLeftCorner<3, 3>() =
      R_base_odom * covariance.block<3, 3>(error::kVelocity, error::kVelocity) *
      R_base_odom.transpose();
  // White noise of one sample at 100 Hz beside the bias.
  const double white2 = imu.gyro_noise_radps_sqrthz * imu.gyro_noise_radps_sqrthz * 100.0;
  odometry.twist_covariance.bottomRightCorner<3, 3>() =
      covariance.block<3, 3>(error::kGyroBias, error::kGyroBias) + white2 * Matrix3d::Identity();
  return odometry;
}

ImuRateOdometry::ImuRateOdometry(const ImuConfig& imu, double max_rate_hz)
    : imu_(imu), period_ns_(from_seconds(1.0 / max_rate_hz)) {}

void ImuRateOdometry::restart(const ScanFilter& filter, const ImuBuffer& imu) {
  running_ = true;
  stamp_ns_ = filter.stamp_ns();
  state_ = filter.state();
  covariance_ = filter.stated_covariance();
  drift_covariance_ = filter.pose_covariance() - filter.pose_covariance_in_local_map();
  catch_up(imu);
}

void ImuRateOdometry::catch_up(const ImuBuffer& imu) {
  if (imu.empty() || imu.newest_ns() <= stamp_ns_) {
    return;
  }
  const double gap_s = imu.longest_gap_s(stamp_ns_, imu.newest_ns());
  for (const InertialStep& step :
       imu.steps_between(stamp_ns_, imu.newest_ns(), kLongestImuRateStep_s)) {
    propagate_covariance(
        step_jacobian(state_, step), imu_, noise_of(imu_, step, gap_s), covariance_);
    state_ = propagate(state_, step);
  }
  stamp_ns_ = imu.newest_ns();
}

std::optional<Odometry> ImuRateOdometry::advance(const ImuBuffer& imu) {
  if (!running_) {
    return std::nullopt;
  }
  catch_up(imu);
  if (stamp_ns_ <= told_ns_) {
    return std::nullopt;
  }
  // Half an IMU interval of grace, so that 100 Hz stays 100 Hz when stamps jitter.
  if (told_ns_ != 0 && stamp_ns_ - told_ns_ < period_ns_ - period_ns_ / 10) {
    return std::nullopt;
  }
  told_ns_ = stamp_ns_;
  return odometry_of(state_,
                     covariance_,
                     in_ros_order(state_, covariance_) + drift_covariance_,
                     imu.samples().back().gyro_radps,
                     imu_,
                     stamp_ns_);
}

}  // namespace trigpoint::lio_mapper
