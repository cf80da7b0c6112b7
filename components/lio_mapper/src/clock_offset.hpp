// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How far the LiDAR's clock is off the IMU's.
// A scan stamped t that was taken at t + d has the attitude of t + d. What the scans alone say of
// the attitude (the minimum of their residuals, without the filter's prior) is compared with the
// gyro's integral to the same stamps: y_k = log(R_scan G_k^T) = a + b t + d R_k omega_k + noise,
// all in odom. a and b, free in every window, take up the start's attitude, the gyro's bias and the
// slow drift of the map; the offset shows where the rate changes within a window: in turns, and in
// every vibration.
#pragma once

#include "trigpoint/base/time.hpp"

#include "attitude_window.hpp"
#include <Eigen/Core>

#include <cstddef>
#include <optional>

namespace trigpoint::lio_mapper {

struct ClockOffset {
  double offset_s{0.0};  ///< to be added to LiDAR stamps
  double sigma_s{0.0};
};

class ClockOffsetEstimator {
 public:
  /// Windows in order of time; an empty one is none.
  void add(const AttitudeWindow& window);

  /// Once enough has been seen.
  std::optional<ClockOffset> estimate() const;

 private:
  // A Kalman filter over windows: offset and its rate at `updated_ns_`.
  Nanoseconds updated_ns_{0};
  Eigen::Vector2d state_{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d covariance_{Eigen::Matrix2d::Zero()};
  std::size_t windows_{0};
  double noise2_rad2_{0.0};  ///< of one attitude, mean over windows
  double excess_{1.0};       ///< squared innovations of windows over what they should be
};

}  // namespace trigpoint::lio_mapper
