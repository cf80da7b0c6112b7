// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/so3.hpp"

#include <cmath>
#include <numbers>

namespace trigpoint {

namespace {
constexpr double kSmallAngle_rad = 1e-7;
}

Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return m;
}

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_rad) {
  const double angle = rotation_rad.norm();
  const double half = 0.5 * angle;
  const double scale =
      angle < kSmallAngle_rad ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
  Eigen::Quaterniond q;
  q.w() = std::cos(half);
  q.vec() = scale * rotation_rad;
  return q.normalized();
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const double sine = q.vec().norm();
  if (sine < kSmallAngle_rad) {
    return 2.0 * sign * q.vec();
  }
  const double angle = 2.0 * std::atan2(sine, sign * q.w());
  return sign * angle / sine * q.vec();
}

Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& rotation_rad) {
  const double angle = rotation_rad.norm();
  const Eigen::Matrix3d a = hat(rotation_rad);
  if (angle < 1e-4) {
    return Eigen::Matrix3d::Identity() - 0.5 * a + a * a / 6.0;
  }
  const double angle2 = angle * angle;
  return Eigen::Matrix3d::Identity() - (1.0 - std::cos(angle)) / angle2 * a +
         (angle - std::sin(angle)) / (angle2 * angle) * a * a;
}

Eigen::Matrix3d so3_right_jacobian_inverse(const Eigen::Vector3d& rotation_rad) {
  const double angle = rotation_rad.norm();
  const Eigen::Matrix3d a = hat(rotation_rad);
  if (angle < 1e-4) {
    return Eigen::Matrix3d::Identity() + 0.5 * a + a * a / 12.0;
  }
  const double factor =
      1.0 / (angle * angle) - (1.0 + std::cos(angle)) / (2.0 * angle * std::sin(angle));
  return Eigen::Matrix3d::Identity() + 0.5 * a + factor * a * a;
}

double yaw_of(const Eigen::Quaterniond& q) {
  return std::atan2(2.0 * (q.w() * q.z() + q.x() * q.y()),
                    1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z()));
}

Eigen::Quaterniond from_yaw(double yaw_rad) {
  return {std::cos(0.5 * yaw_rad), 0.0, 0.0, std::sin(0.5 * yaw_rad)};
}

Eigen::Vector3d roll_pitch_yaw_of(const Eigen::Quaterniond& q) {
  const Eigen::Matrix3d R = q.toRotationMatrix();
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0)));
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

Eigen::Quaterniond from_roll_pitch_yaw(const Eigen::Vector3d& rpy_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(rpy_rad.z(), Eigen::Vector3d::UnitZ()) *
                            Eigen::AngleAxisd(rpy_rad.y(), Eigen::Vector3d::UnitY()) *
                            Eigen::AngleAxisd(rpy_rad.x(), Eigen::Vector3d::UnitX()));
}

double wrap_angle(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? wrapped + 2.0 * std::numbers::pi : wrapped;
}

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to).normalized();
}

}  // namespace trigpoint
