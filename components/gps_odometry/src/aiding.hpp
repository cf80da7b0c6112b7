// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Optional inputs: the velocity of the vehicle (wheels) and its heading (magnetometer, two
// antennas). What such a message must be before it comes near the filter.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <optional>
#include <string>

namespace trigpoint::gps_odometry {

/// A velocity that may be used, in base_link's axes.
struct CheckedTwist {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d velocity_base_mps{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_m2ps2{Eigen::Matrix3d::Identity()};  ///< wide where nothing is known
};

/// A heading that may be used: counter-clockwise from map's east.
struct CheckedYaw {
  Nanoseconds stamp_ns{0};
  double yaw_map_rad{0.0};
  double sigma_rad{0.0};
};

template <typename Checked>
struct AidingVerdict {
  std::optional<Checked> measurement;  ///< nullopt: refused
  std::string reason;                  ///< name of the counter
  std::string text;
};

AidingVerdict<CheckedTwist> check_twist(const TwistMeasurement& twist, const Config& config);
AidingVerdict<CheckedYaw> check_yaw(const YawMeasurement& yaw, const Config& config);

/// Part of a Track: what aiding has done and what it waits for.
struct AidingState {
  Nanoseconds twist_ns{0};  ///< of the newest one used
  Nanoseconds yaw_ns{0};
  /// Heading heard while there was none: add to the relative yaw of the search.
  bool has_prior{false};
  double prior_yaw_map_relative_rad{0.0};
  double prior_sigma_rad{0.0};
  /// The heading rests on such a measurement and motion has not confirmed it yet.
  bool heading_unproven{false};
  /// Motion has contradicted it: not heard again before this.
  Nanoseconds yaw_distrusted_until_ns{0};
};

/// R such that an innovation beyond the gate lies on it: the farther off, the less it weighs.
template <int M>
Eigen::Matrix<double, M, M> clipped(const Eigen::Matrix<double, M, 1>& innovation,
                                    const Eigen::Matrix<double, M, M>& S,
                                    const Eigen::Matrix<double, M, M>& R,
                                    double gate) {
  const double distance2 = innovation.dot(S.ldlt().solve(innovation));
  const double excess = distance2 / gate - 1.0;
  return excess > 0.0 ? Eigen::Matrix<double, M, M>(R + excess * S) : R;
}

}  // namespace trigpoint::gps_odometry
