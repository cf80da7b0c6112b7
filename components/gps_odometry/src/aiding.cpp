// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "aiding.hpp"

#include "trigpoint/base/sentence.hpp"
#include "trigpoint/base/so3.hpp"

#include "fix_checks.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// An axis of which nothing is known.
constexpr double kNothing_m2ps2 = 1e8;
constexpr double kHugeVariance = 1e6;
constexpr int kRefusedInARow = 20;
constexpr Nanoseconds kDistrust_ns = 20 * kNanosecondsPerSecond;

/// A covariance with something in every axis: unknown axes are wide, but forward the default.
Matrix3d usable_covariance(const TwistMeasurement& twist, const Config& config) {
  Matrix3d covariance = 0.5 * (twist.covariance_m2ps2 + twist.covariance_m2ps2.transpose());
  const Vector3d reported = covariance.diagonal();
  for (int i = 0; i < 3; ++i) {
    const bool known = reported(i) > 0.0 && reported(i) < kHugeVariance;
    if (!known) {
      covariance.row(i).setZero();
      covariance.col(i).setZero();
      covariance(i, i) = i == 0 && !(reported(i) >= kHugeVariance)
                             ? config.twist_default_sigma_mps * config.twist_default_sigma_mps
                             : kNothing_m2ps2;
    }
  }
  if (covariance.llt().info() != Eigen::Success) {
    covariance = Matrix3d(covariance.diagonal().asDiagonal());
  }
  // Slip and scale last: one sensor's errors do not average out from sample to sample.
  const double floor =
      std::hypot(config.twist_floor_sigma_mps, config.twist_share * twist.linear_mps.norm());
  return covariance + floor * floor * Matrix3d::Identity();
}

}  // namespace

TwistVerdict check_twist(const TwistMeasurement& twist, const Config& config) {
  if (!is_usable_stamp(twist.stamp_ns)) {
    return {std::nullopt,
            "twist_stamp_out_of_range",
            sentence("Twist refused: its stamp is %g s, expected 0 to 8e9.",
                     to_seconds(twist.stamp_ns))};
  }
  if (!twist.linear_mps.allFinite() || !twist.covariance_m2ps2.allFinite()) {
    return {std::nullopt,
            "twist_not_finite",
            "Twist refused: a value or covariance is not a number, expected m/s and (m/s)^2."};
  }
  if (const double speed = twist.linear_mps.norm(); speed > config.highest_speed_mps) {
    return {std::nullopt,
            "twist_out_of_range",
            sentence("Twist refused: %g m/s, more than highest_speed_mps (km/h?).", speed)};
  }
  return {CheckedTwist{twist.stamp_ns, twist.linear_mps, usable_covariance(twist, config)}, "", ""};
}

bool passes_gate(AidingState& aiding, Nanoseconds stamp_ns, double distance2, double gate) {
  aiding.twists_refused = distance2 <= gate ? 0 : aiding.twists_refused + 1;
  if (aiding.twists_refused >= kRefusedInARow) {
    aiding.twists_refused = 0;
    aiding.twist_distrusted_until_ns = stamp_ns + kDistrust_ns;
  }
  return distance2 <= gate && stamp_ns >= aiding.twist_distrusted_until_ns;
}

}  // namespace trigpoint::gps_odometry
