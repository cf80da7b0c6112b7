// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "warm_start.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr Nanoseconds kListen_ns = kNanosecondsPerSecond;
constexpr double kOldest_s = 3.0;
constexpr double kNewest_s = 0.5;   // the other's stamps may be ahead of our newest IMU sample
constexpr double kInflation = 4.0;  // of variances: another filter's word for itself
// What a vehicle may do after the last odometry.
constexpr double kAcceleration_mps2 = 1.5;
constexpr double kTurnRate_radps = 0.2;
constexpr double kTiltRate_radps = 0.03;
// Least sigmas to begin with. The heading's lies above what counts as converged: DEGRADED until
// own fixes have confirmed it.
constexpr double kLeastPosition_m = 0.05;
constexpr double kLeastTilt_rad = 0.02;
constexpr double kLeastYaw_rad = 0.2;
constexpr double kLeastSpeed_mps = 0.1;
// An odometry that is less certain than this is no better than the next fix.
constexpr double kMostRotation_rad = 0.6;
constexpr double kMostSpeed_mps = 5.0;
constexpr double kMostPosition_m = 100.0;
// Finite is not enough: beyond these, rounding alone makes a covariance indefinite.
constexpr double kNotUnit = 0.05;
constexpr double kFarthest_m = 1e6;
constexpr double kFastest_mps = 350.0;
constexpr double kFastestTurn_radps = 35.0;  // as of the IMU

bool is_positive(const Matrix3d& covariance) {
  return covariance.allFinite() && covariance.diagonal().minCoeff() > 0.0 &&
         Eigen::SelfAdjointEigenSolver<Matrix3d>(0.5 * (covariance + covariance.transpose()))
                 .eigenvalues()
                 .minCoeff() > 0.0;
}

double largest_sigma(const Matrix3d& covariance) {
  return std::sqrt(covariance.diagonal().maxCoeff());
}

Matrix3d inflated(const Matrix3d& covariance) {
  return kInflation * 0.5 * (covariance + covariance.transpose());
}

Matrix3d diagonal(double x, double y, double z) {
  return Vector3d(x, y, z).cwiseAbs2().asDiagonal();
}

}  // namespace

std::optional<std::string> find_warm_start_fault(const Odometry& odometry,
                                                 const std::string& odometry_datum_id,
                                                 const std::string& own_datum_id) {
  if (odometry.frame_id != "map" || odometry.child_frame_id != "base_link") {
    return "it is " + odometry.child_frame_id + " in " + odometry.frame_id +
           ", expected base_link in map";
  }
  if (odometry_datum_id.empty() || odometry_datum_id != own_datum_id) {
    return "its datum is '" + odometry_datum_id + "', expected " + own_datum_id;
  }
  const Matrix3d position = odometry.pose_covariance.topLeftCorner<3, 3>();
  const Matrix3d rotation = odometry.pose_covariance.bottomRightCorner<3, 3>();
  const Matrix3d velocity = odometry.twist_covariance.topLeftCorner<3, 3>();
  if (!odometry.T_frame_child.is_finite() || !odometry.linear_mps.allFinite() ||
      !odometry.angular_radps.allFinite() || !is_positive(position) || !is_positive(rotation) ||
      !is_positive(velocity)) {
    return "it is not finite, or a covariance is not positive";
  }
  if (!(std::abs(odometry.T_frame_child.q.norm() - 1.0) < kNotUnit)) {
    return "its quaternion's norm is " + std::to_string(odometry.T_frame_child.q.norm()) +
           ", expected 1";
  }
  if (odometry.T_frame_child.p.norm() > kFarthest_m || odometry.linear_mps.norm() > kFastest_mps ||
      odometry.angular_radps.norm() > kFastestTurn_radps) {
    return "it is " + std::to_string(odometry.T_frame_child.p.norm() * 1e-3) +
           " km from the datum, at " + std::to_string(odometry.linear_mps.norm()) + " m/s and " +
           std::to_string(odometry.angular_radps.norm()) + " rad/s";
  }
  if (largest_sigma(rotation) > kMostRotation_rad || largest_sigma(velocity) > kMostSpeed_mps ||
      largest_sigma(position) > kMostPosition_m) {
    return "its sigmas are " + std::to_string(largest_sigma(position)) + " m, " +
           std::to_string(largest_sigma(rotation)) + " rad and " +
           std::to_string(largest_sigma(velocity)) + " m/s";
  }
  return std::nullopt;
}

std::optional<WarmState> carry_to(const Odometry& odometry, Nanoseconds now_ns) {
  const double age_s = to_seconds(now_ns - odometry.stamp_ns);
  if (age_s > kOldest_s || age_s < -kNewest_s) {
    return std::nullopt;
  }
  const Eigen::Quaterniond& q = odometry.T_frame_child.q;
  const double turn_rad = (q * odometry.angular_radps).z() * age_s;
  WarmState state;
  state.stamp_ns = now_ns;
  state.T_map_base.q = (from_yaw(turn_rad) * q).normalized();
  state.T_map_base.p =
      odometry.T_frame_child.p + from_yaw(0.5 * turn_rad) * (q * odometry.linear_mps) * age_s;
  state.linear_base_mps = odometry.linear_mps;
  const Matrix3d velocity = inflated(odometry.twist_covariance.topLeftCorner<3, 3>());
  const Matrix3d rotation = inflated(odometry.pose_covariance.bottomRightCorner<3, 3>());
  // Position: what velocity, heading and unknown accelerations make of it in this time.
  const double across_mps = odometry.linear_mps.norm() *
                            std::sqrt(rotation(2, 2) + std::pow(0.5 * kTurnRate_radps * age_s, 2));
  const double moved_m = std::hypot(largest_sigma(velocity) * age_s,
                                    across_mps * age_s,
                                    0.5 * kAcceleration_mps2 * age_s * age_s);
  const double position_m = std::hypot(moved_m, kLeastPosition_m);
  state.position_covariance_m2 = inflated(odometry.pose_covariance.topLeftCorner<3, 3>()) +
                                 diagonal(position_m, position_m, position_m);
  const double tilt_rad = std::hypot(kLeastTilt_rad, kTiltRate_radps * age_s);
  const double yaw_rad = std::hypot(kLeastYaw_rad, kTurnRate_radps * age_s);
  state.rotation_covariance_rad2 = rotation + diagonal(tilt_rad, tilt_rad, yaw_rad);
  const double speed_mps = std::hypot(kLeastSpeed_mps, kAcceleration_mps2 * age_s);
  state.velocity_covariance_m2ps2 = velocity + diagonal(speed_mps, speed_mps, speed_mps);
  return state;
}

void WarmStartListener::hear(const Odometry& odometry, const std::string& datum_id) {
  if (open_ && (!heard_ || odometry.stamp_ns >= heard_->odometry.stamp_ns)) {
    heard_ = Heard{odometry, datum_id};
  }
}

void WarmStartListener::advance(Nanoseconds now_ns) {
  began_ns_ = began_ns_.value_or(now_ns);
  open_ = open_ && now_ns - *began_ns_ <= kListen_ns;
}

}  // namespace trigpoint::gps_odometry
