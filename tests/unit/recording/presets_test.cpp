// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/base/robot.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint::recording {
namespace {

RobotConfig load_preset(const std::string& name) {
  RobotConfig robot;
  load_config(
      {std::string(TRIGPOINT_SOURCE_DIR) + "/config/presets/" + name}, [&](ConfigFields& fields) {
        fields.section("robot", "", [&](ConfigFields& section) { describe(robot, section); });
        for (const char* other : {"bus", "gps_odometry", "lio_mapper", "fusion_gate", "log"}) {
          fields.other_section(other);  // read strictly by the command's own test
        }
      });
  return robot;
}

TEST(Presets, each_loads_strictly) {
  int presets = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(TRIGPOINT_SOURCE_DIR) + "/config/presets")) {
    EXPECT_NO_THROW(load_preset(entry.path().filename().string())) << entry.path();
    ++presets;
  }
  EXPECT_GE(presets, 3);
}

TEST(Presets, the_park_imu_is_turned_about_y_as_lio_sam_says) {
  const auto robot = load_preset("lio_sam_park.yaml");
  EXPECT_EQ("imu_raw", robot.imu_topic);
  EXPECT_EQ("points_raw", robot.points_topic);
  const Eigen::Matrix3d expected = Eigen::Vector3d(-1.0, 1.0, -1.0).asDiagonal();
  EXPECT_LT((robot.q_base_imu().toRotationMatrix() - expected).norm(), 1e-12);
}

TEST(Presets, the_campus_imu_is_upright) {
  const auto robot = load_preset("lio_sam_campus.yaml");
  EXPECT_EQ("imu_correct", robot.imu_topic);
  EXPECT_TRUE(robot.q_base_imu().isApprox(Eigen::Quaterniond::Identity()));
}

}  // namespace
}  // namespace trigpoint::recording
