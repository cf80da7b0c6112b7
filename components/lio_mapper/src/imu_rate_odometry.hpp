// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include "imu_buffer.hpp"
#include "scan_filter.hpp"

#include <optional>

namespace trigpoint::lio_mapper {

/// base_link in odom, with its velocity, in the form that is published.
Odometry odometry_of(const State& state,
                     const ErrorMatrix& covariance,
                     const Matrix6d& pose_covariance,
                     const Eigen::Vector3d& gyro_radps,
                     const ImuConfig& imu,
                     Nanoseconds stamp_ns);

/// Goes on from the newest scan's posterior with every IMU sample.
class ImuRateOdometry {
 public:
  ImuRateOdometry(const ImuConfig& imu, double max_rate_hz);

  /// After the filter has changed: begins anew from it and catches up to the newest sample.
  void restart(const ScanFilter& filter, const ImuBuffer& imu);

  /// Takes the newest sample; the odometry there, unless the last one was less than a period ago.
  std::optional<Odometry> advance(const ImuBuffer& imu);

 private:
  void catch_up(const ImuBuffer& imu);

  ImuConfig imu_;
  Nanoseconds period_ns_;
  bool running_{false};
  Nanoseconds stamp_ns_{0};
  Nanoseconds told_ns_{0};
  State state_;
  ErrorMatrix covariance_{ErrorMatrix::Zero()};
  Matrix6d drift_covariance_{Matrix6d::Zero()};  ///< of odom itself, as at the newest scan
};

}  // namespace trigpoint::lio_mapper
