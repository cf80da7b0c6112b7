// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A LiDAR that leans by a degree and a half more than the configuration says, through the three
// cores with GPS, where the extrinsic is estimated. The accelerometer's bias had taken the lean by
// then: when base turns it must be open again, or the fused height is half a metre off for a
// minute.
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <utility>
#include <vector>

namespace trigpoint {
namespace {

using Eigen::Vector3d;

constexpr double kFor_s = 80.0;
constexpr double kLean_rad = 0.02;
/// RTK has 2 to 3 cm of noise in height.
constexpr double kHeight_m = 0.25;
constexpr double kHeightRms_m = 0.1;

/// Of the fused poses from the first one on.
evaluation::Statistics height_error_m() {
  const auto scenario = simulator::load_scenario("campus");
  const auto reader = simulator::open_scenario(scenario, 1, kFor_s);
  pipeline::CoreConfigs configs;
  configs.robot = *reader->robot();
  configs.robot.lidar_roll_pitch_yaw_base_rad += Vector3d(kLean_rad, -kLean_rad, 0.0);
  configs.lio_mapper.extrinsic.estimate = true;
  configs.gps_odometry.use_configured_datum = true;
  configs.gps_odometry.datum_latitude_deg = scenario.datum.latitude_deg;
  configs.gps_odometry.datum_longitude_deg = scenario.datum.longitude_deg;
  configs.gps_odometry.datum_height_m = scenario.datum.height_m;
  pipeline::Lockstep cores(configs);
  std::vector<double> errors_m;
  while (const auto entry = reader->next()) {
    for (const Odometry& fused : cores.step(*entry).fused) {
      const auto truth = reader->truth()->at(fused.stamp_ns);
      errors_m.push_back(fused.T_frame_child.p.z() - truth.T_map_base.p.z());
    }
  }
  return evaluation::statistics_of(std::move(errors_m));
}

TEST(LeaningLidar, leaves_the_fused_height_right) {
  const evaluation::Statistics error_m = height_error_m();
  std::printf("height: max %.3f m, rms %.3f m (%zu)\n", error_m.max, error_m.rmse, error_m.count);
  EXPECT_GT(error_m.count, 1000U);
  EXPECT_LT(error_m.max, kHeight_m);
  EXPECT_LT(error_m.rmse, kHeightRms_m);
}

}  // namespace
}  // namespace trigpoint
