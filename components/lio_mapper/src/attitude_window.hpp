// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Attitudes that scans alone found, beside what the gyro says of the same seconds.
#pragma once

#include "trigpoint/base/time.hpp"

#include "imu_buffer.hpp"
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <vector>

namespace trigpoint::lio_mapper {

struct AttitudeSample {
  double time_s;              ///< since the window began
  Eigen::Quaterniond q_scan;  ///< odom <- base
  Eigen::Quaterniond q_gyro;  ///< the window's first attitude, carried on by the gyro
  Eigen::Vector3d rate_odom_radps;

  /// log(R_scan R_gyro^T), in odom.
  Eigen::Vector3d difference_rad() const;
};

struct AttitudeWindow {
  Nanoseconds begin_ns{0};
  Nanoseconds end_ns{0};
  std::vector<AttitudeSample> samples;
};

/// Cuts a drive into windows of 3 s without a gap.
class AttitudeWindows {
 public:
  /// The attitude that a scan alone found at its stamp. Scans in order; `imu` reaches back to the
  /// scan before. Gives the window that this ends; empty when none does, or one of too few scans.
  AttitudeWindow add(Nanoseconds stamp_ns,
                     const Eigen::Quaterniond& q_odom_base,
                     const Eigen::Vector3d& gyro_bias_radps,
                     const ImuBuffer& imu);
  /// A scan is missing or not to be trusted, or what it is compared with changes: the window ends
  /// without it.
  AttitudeWindow interrupt();

 private:
  AttitudeWindow window_;
  Eigen::Vector3d gyro_bias_radps_{Eigen::Vector3d::Zero()};
};

}  // namespace trigpoint::lio_mapper
