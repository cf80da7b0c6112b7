// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "calibration_report.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kClockWarning_s = 5e-3;
constexpr double kClockSigmas = 4.0;
constexpr double kRotationWarning_rad = 0.01745;
constexpr double kExtrinsicSigmas = 3.0;
constexpr double kSettledRotation_rad = 3e-3;
constexpr double kSettledShare = 0.25;  // of the configuration's sigma

/// |d| over its sigma along itself.
double sigmas_of(const Vector3d& d, const Matrix3d& covariance) {
  const double norm = d.norm();
  if (norm <= 0.0) {
    return 0.0;
  }
  const double variance = d.dot(covariance * d) / (norm * norm);
  return variance > 0.0 ? norm / std::sqrt(variance) : 0.0;
}

double largest_sigma(const Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, covariance.diagonal().maxCoeff()));
}

std::string extrinsic_text(const Calibration& calibration) {
  const Vector3d rpy = roll_pitch_yaw_of(calibration.T_base_lidar.q);
  char text[200];
  std::snprintf(text,
                sizeof text,
                "robot.lidar_roll_pitch_yaw_base_rad [%.4f, %.4f, %.4f], sigma at most %.4f rad",
                rpy.x(),
                rpy.y(),
                rpy.z(),
                largest_sigma(calibration.extrinsic_covariance.bottomRightCorner<3, 3>()));
  return text;
}

}  // namespace

void CalibrationReport::look(const Calibration& calibration, Nanoseconds stamp_ns, Events& events) {
  look_at_clock(calibration, stamp_ns, events);
  if (estimates_extrinsic_) {
    look_at_extrinsic(calibration, stamp_ns, events);
  }
}

void CalibrationReport::look_at_clock(const Calibration& calibration,
                                      Nanoseconds stamp_ns,
                                      Events& events) {
  const double offset_s = calibration.clock_offset_s;
  const double sigma_s = calibration.clock_offset_sigma_s;
  if (!std::isfinite(offset_s)) {
    return;
  }
  char text[400];
  std::snprintf(text,
                sizeof text,
                "LiDAR stamps are %.1f ms %s against the IMU's clock (sigma %.1f ms)",
                1e3 * std::abs(offset_s),
                offset_s < 0.0 ? "late" : "early",
                1e3 * sigma_s);
  const bool wrong =
      std::abs(offset_s) > kClockWarning_s && std::abs(offset_s) > kClockSigmas * sigma_s;
  if (wrong && std::abs(offset_s - clock_told_s_) > kClockWarning_s) {
    char remedy[120];
    std::snprintf(remedy,
                  sizeof remedy,
                  ": set lio_mapper.sweep.time_offset_s to %.4f",
                  configured_time_offset_s_ + offset_s);
    events.push_back(
        {Severity::kWarning, stamp_ns, "lidar_clock_offset", std::string(text) + remedy});
    clock_told_s_ = offset_s;
  } else if (!clock_known_) {
    events.push_back({Severity::kInfo, stamp_ns, "lidar_clock_offset_known", text});
  }
  clock_known_ = true;
}

void CalibrationReport::look_at_extrinsic(const Calibration& calibration,
                                          Nanoseconds stamp_ns,
                                          Events& events) {
  const Matrix3d rotation = calibration.extrinsic_covariance.bottomRightCorner<3, 3>();
  const Vector3d turn_rad =
      so3_log(configured_T_base_lidar_.q.conjugate() * calibration.T_base_lidar.q);
  if (!extrinsic_warned_ && turn_rad.norm() > kRotationWarning_rad &&
      sigmas_of(turn_rad, rotation) > kExtrinsicSigmas) {
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "the LiDAR is turned by %.2f degrees from what the configuration says: ",
                  turn_rad.norm() * 57.29577951);
    events.push_back({Severity::kWarning,
                      stamp_ns,
                      "extrinsic_differs",
                      text + std::string("rather ") + extrinsic_text(calibration)});
    extrinsic_warned_ = true;
  }
  // About the axis of most turns little shows, so the other two decide.
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(rotation, Eigen::EigenvaluesOnly);
  if (!extrinsic_settled_ && axes.eigenvalues()[1] < kSettledRotation_rad * kSettledRotation_rad) {
    events.push_back({Severity::kInfo, stamp_ns, "extrinsic_settled", extrinsic_text(calibration)});
    extrinsic_settled_ = true;
  }
}

}  // namespace trigpoint::lio_mapper
