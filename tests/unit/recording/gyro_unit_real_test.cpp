// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The gyro's unit on recorded drives: as they are, and as if their gyros spoke in degrees a second.
#include "trigpoint/base/gyro_unit_check.hpp"
#include "trigpoint/recording/log.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <numbers>

namespace trigpoint::recording {
namespace {

constexpr double kDegreesPerRad = 180.0 / std::numbers::pi;

std::optional<std::string> verdict_on(const std::string& path, double scale) {
  LogOptions options;
  options.require_points = false;
  options.require_fix = false;
  const auto log = open_log(path, RobotConfig{}, options);
  GyroUnitCheck check;
  std::optional<std::string> said;
  while (const auto entry = log->next()) {
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      said = check.add(imu->stamp_ns, scale * imu->gyro_radps, imu->accel_mps2);
    }
  }
  return said;
}

class GyroUnitOnRecordedDrives : public testing::TestWithParam<const char*> {};

TEST_P(GyroUnitOnRecordedDrives, is_found_sound_as_recorded_and_wrong_in_degrees) {
  const std::string path = std::string(TRIGPOINT_SHARED_DATA) + GetParam();
  if (!std::filesystem::exists(path)) {
    GTEST_SKIP() << "needs the recorded drive " << path;
  }
  EXPECT_EQ(verdict_on(path, 1.0).value_or(""), "");
  EXPECT_TRUE(verdict_on(path, kDegreesPerRad));
}

INSTANTIATE_TEST_SUITE_P(Drives,
                         GyroUnitOnRecordedDrives,
                         testing::Values("/kitti_2011_09_26_drive_0009",
                                         "/robot_localization/test1.bag"));

}  // namespace
}  // namespace trigpoint::recording
