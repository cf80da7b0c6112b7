// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_checks.hpp"

#include "fix_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Vector3d;

constexpr int kWarmUpSamples = 20;
constexpr double kMeanWeight = 0.02;  // of the newest sample in the running mean
constexpr double kHighestRate_radps = 35.0;
constexpr double kHighestAccel_mps2 = 200.0;
constexpr double kGUnitsBelow_mps2 = 1.5;
constexpr double kGUnitsAbove_mps2 = 0.5;
constexpr double kUpsideDown_mps2 = -4.0;
constexpr int kStuckSamples = 20;
constexpr double kNearLimit = 0.98;
// A stamp this far from the last one is believed when the next ones follow it.
constexpr Nanoseconds kJump_ns = kNanosecondsPerSecond;
constexpr int kJumpSamples = 3;

constexpr Nanoseconds kRestWindow_ns = kNanosecondsPerSecond / 2;
constexpr double kRestGyroSpread_radps = 0.008;
constexpr double kRestAccelSpread_mps2 = 0.06;
constexpr double kRestGyroMean_radps = 0.03;
constexpr int kRestSamples = 20;
constexpr double kRestBiasWeight = 0.3;  // of the newest window

ImuVerdict refuse(const std::string& reason, const char* format, double value) {
  std::array<char, 240> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return {std::nullopt, reason, text.data(), false};
}

double spread(const Vector3d& sum, const Vector3d& square, int count) {
  const Vector3d mean = sum / count;
  return std::sqrt((square / count - mean.cwiseAbs2()).cwiseMax(0.0).maxCoeff());
}

}  // namespace

bool is_saturated(const CheckedImu& imu, const Config& config) {
  return imu.raw_gyro_radps.cwiseAbs().maxCoeff() >= kNearLimit * config.eskf18.gyro_limit_radps ||
         imu.accel_mps2.cwiseAbs().maxCoeff() >= kNearLimit * config.eskf18.accel_limit_mps2;
}

RestBias::RestBias(const Config& config)
    : rest_sigma_radps_(config.gyro_bias_rest_sigma_radps),
      sigma_radps_(config.gyro_bias_sigma_radps) {}

void RestBias::add(Nanoseconds stamp_ns, const Vector3d& gyro_radps, const Vector3d& accel_mps2) {
  quiet_.reset();
  if (count_ > 0 && stamp_ns - window_start_ns_ >= kRestWindow_ns) {
    close_window();
  }
  if (count_ == 0) {
    window_start_ns_ = stamp_ns;
    gyro_sum_ = gyro_square_ = accel_sum_ = accel_square_ = Vector3d::Zero();
  }
  ++count_;
  gyro_sum_ += gyro_radps;
  gyro_square_ += gyro_radps.cwiseAbs2();
  accel_sum_ += accel_mps2;
  accel_square_ += accel_mps2.cwiseAbs2();
}

void RestBias::close_window() {
  const int count = std::exchange(count_, 0);
  if (count < kRestSamples) {
    return;
  }
  const Vector3d mean = gyro_sum_ / count;
  const double gyro_spread = spread(gyro_sum_, gyro_square_, count);
  if (gyro_spread > kRestGyroSpread_radps ||
      spread(accel_sum_, accel_square_, count) > kRestAccelSpread_mps2) {
    return;
  }
  quiet_ = QuietWindow{mean, accel_sum_ / count, gyro_spread / std::sqrt(count)};
  if (mean.norm() > kRestGyroMean_radps) {
    return;
  }
  bias_radps_ =
      known_ ? Vector3d((1.0 - kRestBiasWeight) * bias_radps_ + kRestBiasWeight * mean) : mean;
  known_ = true;
  sigma_radps_ = rest_sigma_radps_;
}

ImuChecks::ImuChecks(const Config& config, const Eigen::Quaterniond& q_base_imu)
    : q_base_imu_(q_base_imu),
      rest_(config),
      previous_(Eigen::Matrix<double, 6, 1>::Constant(kNaN)) {}

void ImuChecks::condemn(const std::string& reason, const std::string& text) {
  fault_ = reason;
  condemned_text_ = text;
}

ImuVerdict ImuChecks::check(const ImuSample& sample) {
  if (!condemned_text_.empty()) {
    return {std::nullopt, fault_, condemned_text_, false};
  }
  if (!sample.gyro_radps.allFinite() || !sample.accel_mps2.allFinite()) {
    return refuse(
        "imu_not_finite", "IMU sample refused: a value is %g, expected finite numbers.", kNaN);
  }
  if (const double rate = sample.gyro_radps.norm(); rate > kHighestRate_radps) {
    return refuse("imu_out_of_range",
                  "IMU sample refused: %g rad/s, expected at most 35 (degrees per second?).",
                  rate);
  }
  if (const double force = sample.accel_mps2.norm(); force > kHighestAccel_mps2) {
    return refuse("imu_out_of_range",
                  "IMU sample refused: %g m/s^2, expected at most 200 (milli-g?).",
                  force);
  }
  if (!is_usable_stamp(sample.stamp_ns)) {
    return refuse("imu_stamp_out_of_range",
                  "IMU sample refused: its stamp is %g s, expected 0 to 8e9.",
                  to_seconds(sample.stamp_ns));
  }
  ImuVerdict verdict = check_stamp(sample);
  if (!verdict.reason.empty() && !verdict.clock_reset) {
    return verdict;
  }
  Eigen::Matrix<double, 6, 1> values;
  values << sample.gyro_radps, sample.accel_mps2;
  identical_ = values == previous_ ? identical_ + 1 : 0;
  previous_ = values;
  if (identical_ >= kStuckSamples) {
    fault_ = "imu_stuck";
    return refuse(fault_,
                  "IMU sample refused: the same six values came %g times in a row, expected noise.",
                  identical_ + 1);
  }
  if (const auto& contradiction =
          gyro_unit_.add(sample.stamp_ns, sample.gyro_radps, sample.accel_mps2)) {
    fault_ = "imu_gyro_in_degrees";
    return {std::nullopt, fault_, "IMU refused from here on: " + *contradiction + ".", false};
  }
  const Vector3d gyro = q_base_imu_ * sample.gyro_radps;
  const Vector3d accel = q_base_imu_ * sample.accel_mps2;
  const double weight = std::max(kMeanWeight, 1.0 / (warm_up_ + 1));
  mean_accel_mps2_ += weight * (accel - mean_accel_mps2_);
  warm_up_ = std::min(warm_up_ + 1, kWarmUpSamples);
  if (warm_up_ < kWarmUpSamples) {
    return verdict;
  }
  if (ImuVerdict mean = check_mean(); !mean.reason.empty()) {
    fault_ = mean.reason;
    return mean;
  }
  fault_.clear();
  rest_.add(sample.stamp_ns, gyro, accel);
  verdict.sample = CheckedImu{sample.stamp_ns,
                              gyro - rest_.bias_radps(),
                              accel,
                              mean_accel_mps2_,
                              rest_.sigma_radps(),
                              gyro,
                              rest_.quiet()};
  return verdict;
}

ImuVerdict ImuChecks::check_stamp(const ImuSample& sample) {
  const Nanoseconds stamp_ns = sample.stamp_ns;
  if (!last_ns_ || (stamp_ns > *last_ns_ && stamp_ns - *last_ns_ <= kJump_ns)) {
    last_ns_ = stamp_ns;
    jump_ns_.reset();
    return {};
  }
  if (stamp_ns == *last_ns_) {
    return refuse("imu_duplicate_stamp",
                  "IMU sample refused: its stamp %.9f s came before.",
                  to_seconds(stamp_ns));
  }
  const double step_s = to_seconds(stamp_ns - *last_ns_);
  if (std::abs(step_s) <= to_seconds(kJump_ns)) {
    return refuse("imu_time_backwards",
                  "IMU sample refused: its stamp is %g s after the last one, expected more than 0.",
                  step_s);
  }
  const bool follows = jump_ns_ && stamp_ns > *jump_ns_ && stamp_ns - *jump_ns_ <= kJump_ns;
  jump_count_ = follows ? jump_count_ + 1 : 1;
  jump_ns_ = stamp_ns;
  if (jump_count_ < kJumpSamples) {
    return refuse(
        "imu_time_jump",
        "IMU sample refused until the next ones follow it: its stamp is %g s after the last one.",
        step_s);
  }
  ImuVerdict verdict =
      refuse("imu_clock_reset",
             "The IMU's clock moved by %g s and stays there (a gap, or a log played again).",
             step_s);
  verdict.clock_reset = true;
  last_ns_ = stamp_ns;
  jump_ns_.reset();
  return verdict;
}

ImuVerdict ImuChecks::check_mean() {
  const double norm = mean_accel_mps2_.norm();
  if (norm > kGUnitsAbove_mps2 && norm < kGUnitsBelow_mps2) {
    return refuse("imu_units_g",
                  "IMU refused: the mean specific force is %.3g, expected about 9.8 m/s^2; the "
                  "accelerometer seems to send g units.",
                  norm);
  }
  if (norm <= kGUnitsAbove_mps2) {
    return refuse("imu_without_gravity",
                  "IMU refused: the mean specific force is %.3g m/s^2, expected about 9.8; gravity "
                  "seems to have been removed.",
                  norm);
  }
  if (mean_accel_mps2_.z() < kUpsideDown_mps2) {
    return refuse(
        "imu_upside_down",
        "IMU refused: the mean specific force along base_link's z is %.3g m/s^2, expected about "
        "+9.8; upside down, or axes north-east-down: see imu_roll_pitch_yaw_base_rad.",
        mean_accel_mps2_.z());
  }
  return {};
}

}  // namespace trigpoint::gps_odometry
