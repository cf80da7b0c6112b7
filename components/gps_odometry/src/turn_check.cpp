// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "turn_check.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace trigpoint::gps_odometry {

namespace {

constexpr double kLongestTurnStep_s = 0.2;
constexpr Nanoseconds kYawInterval_ns = kNanosecondsPerSecond / 20;
constexpr Nanoseconds kYawHistory_ns = 2 * kNanosecondsPerSecond;
constexpr double kLeg_m = 2.0;
constexpr double kLegSigmas = 10.0;  // a course good to 0.14 rad
constexpr Nanoseconds kLongestLeg_ns = 10 * kNanosecondsPerSecond;
// A quarter turn on the spot to the left and then in reverse is one of the course to the right:
// what was slower than this since the leg began may have changed gear.
constexpr double kStands_mps = 0.5;
constexpr double kReversal_rad = 2.0;  // a change of course that may be a change of gear
constexpr double kEnough_rad = 1.5 * std::numbers::pi;
constexpr double kSharedVariance = 0.8;  // of gyro and course, to judge at all
constexpr double kOppositeBelow = -0.5;

}  // namespace

void TurnCheck::restart() {
  *this = TurnCheck{};
}

void TurnCheck::add_imu(Nanoseconds stamp_ns,
                        const Eigen::Vector3d& gyro_radps,
                        const Eigen::Vector3d& up_base) {
  const double elapsed_s = imu_ns_ ? to_seconds(stamp_ns - *imu_ns_) : 0.0;
  imu_ns_ = stamp_ns;
  if (elapsed_s < 0.0 || elapsed_s > kLongestTurnStep_s) {
    restart();
    imu_ns_ = stamp_ns;
    return;
  }
  yaw_rad_ += elapsed_s * gyro_radps.dot(up_base.normalized());
  if (yaws_.empty() || stamp_ns - yaws_.back().stamp_ns >= kYawInterval_ns) {
    yaws_.push_back({stamp_ns, yaw_rad_});
  }
  while (yaws_.front().stamp_ns < stamp_ns - kYawHistory_ns) {
    yaws_.pop_front();
  }
}

std::optional<double> TurnCheck::yaw_at(Nanoseconds stamp_ns) const {
  const auto after = std::find_if(
      yaws_.begin(), yaws_.end(), [&](const Yaw& y) { return y.stamp_ns >= stamp_ns; });
  if (after != yaws_.end()) {
    return after->yaw_rad;
  }
  return !yaws_.empty() && stamp_ns - yaws_.back().stamp_ns < 2 * kYawInterval_ns
             ? std::optional(yaw_rad_)
             : std::nullopt;
}

TurnVerdict TurnCheck::add_fix(Nanoseconds stamp_ns,
                               const Eigen::Vector2d& antenna_map_m,
                               double sigma_m) {
  const auto yaw = yaw_at(stamp_ns);
  if (!yaw || (newest_ && stamp_ns <= newest_->stamp_ns)) {
    return {};
  }
  const Point now{stamp_ns, antenna_map_m, *yaw};
  const bool stands = newest_ && (antenna_map_m - newest_->antenna_map_m).norm() <
                                     kStands_mps * to_seconds(stamp_ns - newest_->stamp_ns);
  has_stood_ = has_stood_ || stands;
  newest_ = now;
  if (!last_ || stamp_ns - last_->stamp_ns > kLongestLeg_ns) {
    last_ = now;
    leg_.reset();
    return {};
  }
  const Eigen::Vector2d step = antenna_map_m - last_->antenna_map_m;
  if (step.norm() < std::max(kLeg_m, kLegSigmas * sigma_m)) {
    return {};
  }
  const Leg leg{std::atan2(step.y(), step.x()), 0.5 * (last_->yaw_rad + *yaw)};
  last_ = now;
  const std::optional<Leg> before = leg_;
  leg_ = std::exchange(has_stood_, false) ? std::nullopt : std::optional(leg);
  if (!before || !leg_) {
    return {};
  }
  const double course = wrap_angle(leg.course_rad - before->course_rad);
  if (std::abs(course) > kReversal_rad) {
    return {};
  }
  const double gyro = leg.yaw_rad - before->yaw_rad;
  turned_rad_ += std::abs(course);
  course_course_ += course * course;
  gyro_course_ += gyro * course;
  gyro_gyro_ += gyro * gyro;
  return turned_rad_ > kEnough_rad ? judge() : TurnVerdict{};
}

/// Slope of gyro over course by least squares: 1 is right, -1 an axis the wrong way. Degrees a
/// second are found by GyroUnitCheck, and sooner.
TurnVerdict TurnCheck::judge() {
  const double slope = gyro_course_ / course_course_;
  const bool is_clear = gyro_course_ * gyro_course_ > kSharedVariance * gyro_gyro_ * course_course_;
  turned_rad_ = course_course_ = gyro_course_ = gyro_gyro_ = 0.0;
  if (is_clear && slope < kOppositeBelow) {
    return {"imu_gyro_sign",
            "IMU refused: the gyro turns " + std::to_string(slope) +
                " times as far as the course of the fixes, expected 1: an axis has the wrong sign, "
                "or the mounting is wrong (imu_roll_pitch_yaw_base_rad)."};
  }
  return {};
}

}  // namespace trigpoint::gps_odometry
