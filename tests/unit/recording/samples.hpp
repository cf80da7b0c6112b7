// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Measurements with a different number in every place, so that a swapped field is seen.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/recording/log.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace trigpoint::recording {

inline constexpr Nanoseconds kStart_ns = 1'316'000'000'123'456'789;
inline constexpr Nanoseconds kMillisecond_ns = 1'000'000;

inline ImuSample sample_imu(int index) {
  ImuSample imu;
  imu.stamp_ns = kStart_ns + index * 10 * kMillisecond_ns;
  imu.frame_id = "imu_link";
  imu.gyro_radps = {0.1 + index, 0.2, 0.3};
  imu.accel_mps2 = {0.4, 0.5 + index * 1e-3, 9.81};
  imu.q_world_base = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  return imu;
}

inline GnssFix sample_fix(int index) {
  GnssFix fix;
  fix.stamp_ns = kStart_ns + index * 100 * kMillisecond_ns;
  fix.frame_id = "gnss_antenna";
  fix.status = FixStatus::kGbas;
  fix.service = 3;
  fix.latitude_deg = 49.0 + index * 1e-6;
  fix.longitude_deg = 8.4;
  fix.altitude_m = 116.25;
  fix.covariance_enu_m2 << 0.01, 0.002, 0.003, 0.002, 0.04, 0.005, 0.003, 0.005, 0.09;
  fix.covariance_type = CovarianceType::kKnown;
  return fix;
}

inline TwistMeasurement sample_twist(int index) {
  TwistMeasurement twist;
  twist.stamp_ns = kStart_ns + index * 20 * kMillisecond_ns;
  twist.frame_id = "rear_axle";
  twist.linear_mps = {1.5 + index, 0.25, -0.125};
  twist.covariance_m2ps2 << 0.01, 0.002, 0.003, 0.004, 0.05, 0.006, 0.007, 0.008, 0.09;
  return twist;
}

inline YawMeasurement sample_yaw(int index) {
  YawMeasurement yaw;
  yaw.stamp_ns = kStart_ns + index * 200 * kMillisecond_ns;
  yaw.frame_id = "compass";
  yaw.q_world_base = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.75);  // of no unit length: as it came
  yaw.variance_rad2 = 0.04 + index;
  return yaw;
}

inline void expect_equal(const TwistMeasurement& expected, const TwistMeasurement& twist) {
  EXPECT_EQ(expected.stamp_ns, twist.stamp_ns);
  EXPECT_EQ(expected.frame_id, twist.frame_id);
  EXPECT_EQ(expected.linear_mps, twist.linear_mps);
  EXPECT_EQ(expected.covariance_m2ps2, twist.covariance_m2ps2);
}

inline void expect_equal(const YawMeasurement& expected, const YawMeasurement& yaw) {
  EXPECT_EQ(expected.stamp_ns, yaw.stamp_ns);
  EXPECT_EQ(expected.frame_id, yaw.frame_id);
  ASSERT_TRUE(yaw.q_world_base);
  EXPECT_EQ(expected.q_world_base->coeffs(), yaw.q_world_base->coeffs());
  EXPECT_EQ(expected.variance_rad2, yaw.variance_rad2);
}

inline PointCloudMessage sample_cloud(int index, std::uint32_t points = 100) {
  PointCloudMessage cloud;
  cloud.stamp_ns = kStart_ns + index * 100 * kMillisecond_ns;
  cloud.frame_id = "lidar";
  cloud.width = points;
  cloud.fields = {{"x", 0, 7, 1}, {"y", 4, 7, 1}, {"z", 8, 7, 1}, {"time", 12, 7, 1}};
  cloud.point_step = 16;
  cloud.row_step = points * cloud.point_step;
  for (std::uint32_t i = 0; i < cloud.row_step; ++i) {
    cloud.data.push_back(static_cast<std::uint8_t>(i * 7 + static_cast<std::uint32_t>(index)));
  }
  return cloud;
}

inline std::vector<LogEntry> read_all(LogReader& log) {
  std::vector<LogEntry> entries;
  while (auto entry = log.next()) {
    entries.push_back(std::move(*entry));
  }
  return entries;
}

template <class Measurement>
std::vector<Measurement> only(const std::vector<LogEntry>& entries) {
  std::vector<Measurement> found;
  for (const auto& entry : entries) {
    if (const auto* measurement = std::get_if<Measurement>(&entry.measurement)) {
      found.push_back(*measurement);
    }
  }
  return found;
}

}  // namespace trigpoint::recording
