// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A LiDAR that leans by a degree and a half more than the configuration says, through the three
// cores with GPS, where the extrinsic is estimated. The accelerometer's bias had taken the lean by
// then: when base turns it must be open again, or the fused height is half a metre off for a
// minute.
#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trigpoint {
namespace {

using Eigen::Vector3d;

constexpr double kFor_s = 80.0;
constexpr double kLean_rad = 0.02;
/// RTK has 2 to 3 cm of noise in height.
constexpr double kHeight_m = 0.25;
constexpr double kHeightRms_m = 0.1;

struct HeightError {
  double max_m{0.0};
  double rms_m{0.0};
  std::size_t count{0};
};

/// Of the fused poses from the first one on.
HeightError height_error() {
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
  HeightError error;
  while (const auto entry = reader->next()) {
    for (const Odometry& fused : cores.step(*entry).fused) {
      const auto truth = reader->truth()->at(fused.stamp_ns);
      const double e_m = fused.T_frame_child.p.z() - truth.T_map_base.p.z();
      error.max_m = std::max(error.max_m, std::abs(e_m));
      error.rms_m += e_m * e_m;
      ++error.count;
    }
  }
  error.rms_m = std::sqrt(error.rms_m / static_cast<double>(error.count));
  std::printf("height: max %.3f m, rms %.3f m (%zu)\n", error.max_m, error.rms_m, error.count);
  return error;
}

TEST(LeaningLidar, leaves_the_fused_height_right) {
  const HeightError error = height_error();
  EXPECT_GT(error.count, 1000U);
  EXPECT_LT(error.max_m, kHeight_m);
  EXPECT_LT(error.rms_m, kHeightRms_m);
}

}  // namespace
}  // namespace trigpoint
