// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Measurements with a different number in every place, so that a swapped field is seen.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/recording/log.hpp"

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
