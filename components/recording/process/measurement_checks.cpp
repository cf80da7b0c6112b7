// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "measurement_checks.hpp"

#include "trigpoint/base/sentence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>

namespace trigpoint::recording {

namespace {

constexpr double kGravity_mps2 = 9.81;
/// Fixes come late and out of order; so far back the GPS filters still take them
/// (gps_odometry.rewind_s).
constexpr Nanoseconds kLateFix_ns = 2'500'000'000;
constexpr double kGravityTolerance_mps2 = 2.0;
constexpr double kFastestRobot_radps = 12.0;  ///< more is most likely degrees per second
constexpr std::uint64_t kEnoughImuSamples = 50;
constexpr double kFarthestMedian_m = 300.0;  ///< more is most likely millimetres

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return text.data();
}

/// Neither is possible as it is, and both are the other way round.
bool are_swapped(const GnssFix& fix) {
  return std::abs(fix.latitude_deg) > 90.0 && std::abs(fix.latitude_deg) <= 180.0 &&
         std::abs(fix.longitude_deg) <= 90.0;
}

bool has_field(const PointCloudMessage& cloud, const std::vector<std::string>& names) {
  return std::any_of(cloud.fields.begin(), cloud.fields.end(), [&names](const PointField& field) {
    return std::find(names.begin(), names.end(), field.name) != names.end();
  });
}

/// Where a cloud has x, y and z as float32, as the mapper takes them; -1 where not.
std::array<std::int64_t, 3> offsets_of_xyz(const PointCloudMessage& cloud) {
  constexpr std::uint8_t kFloat32 = 7;
  std::array<std::int64_t, 3> offsets{-1, -1, -1};
  for (const PointField& field : cloud.fields) {
    const std::size_t axis = std::string("xyz").find(field.name);
    if (field.name.size() == 1 && axis != std::string::npos && field.datatype == kFloat32) {
      offsets[axis] = field.offset;
    }
  }
  return offsets;
}

/// Of some hundred points; nothing where none has returned, or the cloud is not as the mapper takes
/// it.
std::optional<double> median_range_m(const PointCloudMessage& cloud) {
  constexpr std::size_t kLooks = 500;
  const auto offsets = offsets_of_xyz(cloud);
  const auto [first, last] = std::minmax_element(offsets.begin(), offsets.end());
  const std::size_t points = cloud.point_step > 0 ? cloud.data.size() / cloud.point_step : 0;
  if (*first < 0 || *last + 4 > cloud.point_step || cloud.is_bigendian) {
    return std::nullopt;
  }
  std::vector<double> ranges_m;
  for (std::size_t i = 0; i < points; i += points / kLooks + 1) {
    Eigen::Vector3f p;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const auto offset = static_cast<std::size_t>(offsets[static_cast<std::size_t>(axis)]);
      std::memcpy(&p[axis], cloud.data.data() + i * cloud.point_step + offset, sizeof(float));
    }
    if (p.allFinite() && !p.isZero(0.0F)) {
      ranges_m.push_back(p.cast<double>().norm());
    }
  }
  if (ranges_m.empty()) {
    return std::nullopt;
  }
  const auto middle = ranges_m.begin() + static_cast<std::ptrdiff_t>(ranges_m.size() / 2);
  std::nth_element(ranges_m.begin(), middle, ranges_m.end());
  return *middle;
}

}  // namespace

void MeasurementChecks::take(const ImuSample& sample) {
  check_stamp(sample.stamp_ns, sample.frame_id);
  if (!sample.accel_mps2.allFinite() || !sample.gyro_radps.allFinite()) {
    note("a value that is not finite (NaN or infinite): the sample is of no use");
    return;
  }
  ++imu_samples_;
  accel_sum_mps2_ += sample.accel_mps2.norm();
  accel_z_sum_mps2_ += sample.accel_mps2.z();
  gyro_peak_radps_ = std::max(gyro_peak_radps_, sample.gyro_radps.cwiseAbs().maxCoeff());
}

void MeasurementChecks::take(const GnssFix& fix) {
  check_stamp(fix.stamp_ns, fix.frame_id, kLateFix_ns);
  if (fix.status == FixStatus::kNoFix) {
    note("no fix (status -1)");
  }
  if (fix.latitude_deg == 0.0 && fix.longitude_deg == 0.0) {
    note("latitude and longitude are exactly 0: the receiver has no position");
  }
  if (!std::isfinite(fix.latitude_deg) || !std::isfinite(fix.longitude_deg) ||
      !std::isfinite(fix.altitude_m)) {
    note("a position that is not finite (NaN or infinite): the fix is of no use");
  } else if (std::abs(fix.latitude_deg) > 90.0 || std::abs(fix.longitude_deg) > 180.0) {
    note(are_swapped(fix) ? "latitude and longitude are swapped: a latitude is within 90 degrees"
                          : "latitude or longitude out of range (90 and 180 degrees)");
  }
  if (origin_ == Origin::kOurs) {
    return;
  }
  if (!fix.covariance_enu_m2.allFinite()) {
    note("a covariance that is not finite (NaN or infinite)");
  } else if (fix.covariance_type == CovarianceType::kUnknown ||
             fix.covariance_enu_m2.trace() <= 0.0) {
    note("the fix says nothing of its covariance: a class default is assumed");
  }
}

void MeasurementChecks::take(const PointCloudMessage& cloud) {
  check_stamp(cloud.stamp_ns, cloud.frame_id);
  if (cloud.width == 0 || cloud.height == 0) {
    if (origin_ == Origin::kSensor) {  // our map is empty before it begins
      note("an empty cloud");
    }
  } else if (!has_field(cloud, {"x"}) || !has_field(cloud, {"y"}) || !has_field(cloud, {"z"})) {
    note("the cloud lacks a field x, y or z");
  } else if (origin_ == Origin::kSensor &&
             !has_field(cloud, {"time", "t", "timestamp", "time_stamp", "offset_time"})) {
    note(
        "the points carry no time (no field time, t or timestamp): set lio_mapper.sweep.point_time "
        "to azimuth or snapshot");
  }
  if (const auto range_m = median_range_m(cloud); range_m && origin_ == Origin::kSensor) {
    ++clouds_with_ranges_;
    range_sum_m_ += *range_m;
  }
}

void MeasurementChecks::take(const Odometry& odometry) {
  constexpr double kUnitLengthTolerance = 1e-3;
  check_stamp(odometry.stamp_ns, odometry.frame_id);
  if (odometry.child_frame_id.empty()) {
    note("an empty child_frame_id: base_link is expected, or gnss_antenna");
  }
  const auto& T_frame_child = odometry.T_frame_child;
  if (!T_frame_child.p.allFinite() || !T_frame_child.q.coeffs().allFinite()) {
    note("a pose that is not finite (NaN or infinite)");
  } else if (std::abs(T_frame_child.q.norm() - 1.0) > kUnitLengthTolerance) {
    note("an orientation that is no unit quaternion");
  }
}

void MeasurementChecks::note(const std::string& sentence) {
  ++notes_[sentence];
}

std::vector<std::string> MeasurementChecks::remarks() const {
  std::vector<std::string> all;
  for (const auto& [sentence, count] : notes_) {
    all.push_back(sentence + " (" + std::to_string(count) + " times)");
  }
  const double range_m =
      clouds_with_ranges_ > 0 ? range_sum_m_ / static_cast<double>(clouds_with_ranges_) : 0.0;
  if (range_m > kFarthestMedian_m) {
    all.push_back(
        sentence("half of the points are farther than %.0f: are they in millimetres? m is expected",
                 range_m));
  }
  if (imu_samples_ < kEnoughImuSamples) {
    return all;
  }
  const auto samples = static_cast<double>(imu_samples_);
  const double mean_mps2 = accel_sum_mps2_ / samples;
  if (mean_mps2 > 0.8 && mean_mps2 < 1.2) {
    all.push_back("acceleration has a mean of " + number(mean_mps2) +
                  ": it is in g; m/s^2 is expected");
  } else if (std::abs(mean_mps2 - kGravity_mps2) > kGravityTolerance_mps2) {
    all.push_back("acceleration has a mean of " + number(mean_mps2) +
                  " m/s^2; about 9.81, gravity included, is expected");
  } else if (accel_z_sum_mps2_ < 0.0) {
    all.push_back("acceleration along z is " + number(accel_z_sum_mps2_ / samples) +
                  " m/s^2: +9.81 at rest is expected; is the IMU upside down "
                  "(robot.imu_roll_pitch_yaw_base_rad)?");
  }
  if (gyro_peak_radps_ > kFastestRobot_radps) {
    all.push_back("angular rate peaks at " + number(gyro_peak_radps_) +
                  ": is it in degrees per second? rad/s is expected");
  }
  return all;
}

/// Stamps of some topics may go back by `allowed_ns`.
void MeasurementChecks::check_stamp(Nanoseconds stamp_ns,
                                    const std::string& frame_id,
                                    Nanoseconds allowed_ns) {
  if (stamp_ns <= 0 && origin_ == Origin::kSensor) {
    note("a stamp of 0");
  } else if (stamp_ns < newest_ns_ - allowed_ns) {
    note(allowed_ns > 0 ? "a stamp that goes back farther than late fixes are used"
                        : "a stamp that goes back");
  }
  newest_ns_ = std::max(newest_ns_, stamp_ns);
  if (frame_id.empty()) {
    note("an empty frame_id");
  } else if (frame_id.front() == '/') {
    note("frame_id '" + frame_id +
         "' begins with a slash, as in ROS 1: tf2 of ROS 2 finds no such frame");
  }
}

}  // namespace trigpoint::recording
