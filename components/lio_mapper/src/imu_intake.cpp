// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_intake.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

/// No robot turns or accelerates like that: 5700 deg/s and 50 g.
constexpr double kMaxGyro_radps = 100.0;
constexpr double kMaxForce_mps2 = 500.0;
/// No range ends below these; a robot at rest shows the same reading again and again.
constexpr double kLeastGyroRange_radps = 0.25;
constexpr double kLeastForceRange_mps2 = 10.8;
constexpr int kRepeats = 3;
constexpr int kChanges = 50;  ///< that show the axis to have noise
constexpr double kSaturationEvery_s = 5.0;

}  // namespace

void Tally::add(const std::string& reason) {
  const auto known = std::find_if(
      counts_.begin(), counts_.end(), [&](const NamedCount& c) { return c.name == reason; });
  if (known == counts_.end()) {
    counts_.push_back({reason, 1});
  } else {
    ++known->count;
  }
}

bool SaturationCheck::add(double value, double least, Axis& axis) {
  const double magnitude = std::abs(value);
  axis.repeats = value == axis.last ? axis.repeats + 1 : 1;
  axis.changes += value == axis.last ? 0 : 1;
  axis.last = value;
  axis.largest = std::max(axis.largest, magnitude);
  return magnitude > least && magnitude == axis.largest && axis.repeats >= kRepeats &&
         axis.changes > kChanges;
}

bool SaturationCheck::add(const Eigen::Vector3d& gyro_radps, const Eigen::Vector3d& accel_mps2) {
  bool any = false;
  for (int i = 0; i < 3; ++i) {
    const auto at = static_cast<std::size_t>(i);
    any = add(gyro_radps[i], kLeastGyroRange_radps, axes_[at]) || any;
    any = add(accel_mps2[i], kLeastForceRange_mps2, axes_[at + 3]) || any;
  }
  return any;
}

std::optional<Event> ImuIntake::objection(const ImuSample& sample) const {
  if (!sample.gyro_radps.allFinite() || !sample.accel_mps2.allFinite()) {
    return Event{Severity::kWarning,
                 sample.stamp_ns,
                 "imu_not_finite",
                 "refused an IMU sample with values that are not finite"};
  }
  if (sample.gyro_radps.norm() > kMaxGyro_radps || sample.accel_mps2.norm() > kMaxForce_mps2) {
    return Event{Severity::kWarning,
                 sample.stamp_ns,
                 "imu_out_of_range",
                 "refused an IMU sample of " + std::to_string(sample.gyro_radps.norm()) +
                     " rad/s and " + std::to_string(sample.accel_mps2.norm()) +
                     " m/s^2, expected at most 100 and 500: degrees per second, or another unit?"};
  }
  if (accepted_ > 0 && sample.stamp_ns <= newest_ns_) {
    return Event{Severity::kWarning,
                 sample.stamp_ns,
                 "imu_stamp_not_after_previous",
                 "refused an IMU sample " +
                     std::to_string(to_seconds(newest_ns_ - sample.stamp_ns)) +
                     " s older than its predecessor, expected stamps that grow"};
  }
  return std::nullopt;
}

std::optional<InertialSample> ImuIntake::accept(const ImuSample& sample,
                                                double max_gap_s,
                                                Events& events) {
  ++received_;
  if (const auto event = objection(sample)) {
    events.push_back(*event);
    return std::nullopt;
  }
  if (const auto& contradiction =
          gyro_unit_.add(sample.stamp_ns, sample.gyro_radps, sample.accel_mps2)) {
    events.push_back({Severity::kError,
                      sample.stamp_ns,
                      "imu_gyro_in_degrees",
                      "refused this IMU from here on: " + *contradiction});
    return std::nullopt;
  }
  const double interval_s = to_seconds(sample.stamp_ns - newest_ns_);
  if (accepted_ > 0 && interval_s > max_gap_s) {
    events.push_back({Severity::kWarning,
                      sample.stamp_ns,
                      "imu_gap",
                      "no IMU samples for " + std::to_string(interval_s) + " s, expected at most " +
                          std::to_string(max_gap_s) + " s: the motion in between is a guess"});
  }
  const bool saturated = saturation_.add(sample.gyro_radps, sample.accel_mps2);
  if (saturated && (saturation_told_ns_ == 0 ||
                    to_seconds(sample.stamp_ns - saturation_told_ns_) > kSaturationEvery_s)) {
    events.push_back({Severity::kWarning,
                      sample.stamp_ns,
                      "imu_saturated",
                      "the IMU stands at the end of its range (" +
                          std::to_string(sample.gyro_radps.cwiseAbs().maxCoeff()) + " rad/s, " +
                          std::to_string(sample.accel_mps2.cwiseAbs().maxCoeff()) +
                          " m/s^2): the motion beyond it is a guess"});
    saturation_told_ns_ = sample.stamp_ns;
  }
  newest_ns_ = sample.stamp_ns;
  ++accepted_;
  return InertialSample{
      sample.stamp_ns, q_base_imu_ * sample.gyro_radps, q_base_imu_ * sample.accel_mps2, saturated};
}

}  // namespace trigpoint::lio_mapper
