// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "lidar_model.hpp"

#include "clouds.hpp"
#include "relief.hpp"
#include "scenarios.hpp"
#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr std::uint64_t kLidarSeed = 2;
constexpr double kWallFace_m = 50.0;  ///< east

/// A wall across the way of a robot that drives and turns.
struct WallAhead {
  explicit WallAhead(const std::string& more = "")
      : scenario(small_scenario(more)),
        relief(scenario.world, kLidarSeed),
        drive(scenario, relief, kLidarSeed, scenario.duration_s),
        world(relief, {wall()}, drive.track(1.0), 120.0) {}

  static Shape wall() {
    Shape box;
    box.centre_m = {kWallFace_m + 1.0, 20.0, 0.0};
    box.half_m = {1.0, 60.0, 30.0};
    box.reflectivity = 0.6;
    return box;
  }

  PointCloudMessage scan(double t_s) const {
    const SpinningLidar lidar(scenario.lidar, scenario.robot.T_base_lidar(), kLidarSeed);
    SweepEpoch sweep;
    sweep.stamp_ns = scenario.start_ns() + from_seconds(t_s);
    return lidar.scan(sweep, drive, world);
  }

  Scenario scenario;
  Relief relief;
  Drive drive;
  World world;
};

const std::string kPerfect =
    "robot: {lidar_position_base_m: [0.3, 0.1, 0.8], lidar_roll_pitch_yaw_base_rad: [0.02, -0.05, "
    "0.3]}\n"
    "lidar: {range_sigma_m: 0.0, dropout: 0.0}\n";

/// Largest distance to the wall's face of the points on it, each placed with the pose at `stamp +
/// share * time`.
double thickness_of_wall(const WallAhead& setup, double t_s, double share) {
  const PointCloudMessage cloud = setup.scan(t_s);
  const Pose T_base_lidar = setup.scenario.robot.T_base_lidar();
  double thickness = 0.0;
  int on_wall = 0;
  for (const TestPoint& point : points_of(cloud)) {
    const Nanoseconds stamp_ns =
        cloud.stamp_ns + from_seconds(share * static_cast<double>(point.time_s));
    const Eigen::Vector3d p = setup.drive.at(stamp_ns).T_map_base * (T_base_lidar * point.p_m);
    const bool above_ground = p.z() > setup.relief.height_m(p.x(), p.y()) + 0.5;
    if (above_ground && p.x() > kWallFace_m - 2.0) {
      ++on_wall;
      thickness = std::max(thickness, std::abs(p.x() - kWallFace_m));
    }
  }
  EXPECT_GT(on_wall, 500);
  return thickness;
}

}  // namespace

TEST(SpinningLidar, sees_a_wall_flat_once_every_point_is_placed_with_the_pose_of_its_own_time) {
  const WallAhead setup(kPerfect);
  constexpr double kFloat_m = 5e-5;  // float32 coordinates and times
  for (const double t_s : {1.0, 8.0, 11.0, 12.0, 13.0}) {
    EXPECT_LT(thickness_of_wall(setup, t_s, 1.0), kFloat_m) << "at " << t_s;
  }
}

TEST(SpinningLidar, smears_the_wall_when_the_motion_during_the_sweep_is_ignored) {
  const WallAhead setup(kPerfect);
  EXPECT_GT(thickness_of_wall(setup, 8.0, 0.0), 0.1);
  EXPECT_GT(thickness_of_wall(setup, 8.0, 0.9), 0.01);
}

TEST(SpinningLidar, gives_the_same_bytes_for_any_number_of_threads) {
  WallAhead setup;
  setup.scenario.lidar.threads = 1;
  const PointCloudMessage one = setup.scan(9.0);
  for (const int threads : {2, 3, 7}) {
    setup.scenario.lidar.threads = threads;
    EXPECT_EQ(setup.scan(9.0).data, one.data) << threads;
  }
}

TEST(SpinningLidar, scatters_ranges_by_the_configured_sigma) {
  const WallAhead perfect("lidar: {range_sigma_m: 0.0, dropout: 0.0}\n");
  const WallAhead noisy("lidar: {range_sigma_m: 0.02, dropout: 0.0}\n");
  const auto a = points_of(perfect.scan(1.0));
  const auto b = points_of(noisy.scan(1.0));
  ASSERT_EQ(a.size(), b.size());
  double square = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    // Nearly at right angles to the wall, where the spot is round.
    if (a[i].p_m.x() > 40.0 && std::abs(a[i].p_m.y()) < 4.0 && a[i].p_m.z() > 0.0) {
      square += std::pow(b[i].p_m.norm() - a[i].p_m.norm(), 2);
      ++count;
    }
  }
  ASSERT_GT(count, 200);
  EXPECT_NEAR(std::sqrt(square / count), 0.02, 0.02 * 5.0 / std::sqrt(2.0 * count));
}

TEST(SpinningLidar, packs_points_as_the_velodyne_driver_does_in_order_of_time) {
  const WallAhead setup;
  const PointCloudMessage cloud = setup.scan(5.0);
  ASSERT_EQ(cloud.fields.size(), 6U);
  EXPECT_EQ(cloud.fields[4].name, "ring");
  EXPECT_EQ(cloud.fields[4].datatype, 4);
  EXPECT_EQ(cloud.fields[5].name, "time");
  EXPECT_EQ(cloud.data.size(), static_cast<std::size_t>(cloud.width) * cloud.point_step);
  float before_s = 0.0F;
  for (const TestPoint& point : points_of(cloud)) {
    ASSERT_GE(point.time_s, before_s);
    ASSERT_LT(point.time_s, 0.1F);
    ASSERT_LT(point.ring, 16);
    ASSERT_TRUE(point.p_m.allFinite());
    before_s = point.time_s;
  }
}

TEST(SpinningLidar, points_every_ring_at_its_elevation) {
  for (const std::string& name : lidar_model_names()) {
    WallAhead setup("lidar: {model: " + name + "}\n");
    const LidarModel model = lidar_model(name);
    for (const TestPoint& point : points_of(setup.scan(1.0))) {
      ASSERT_NEAR(
          std::asin(point.p_m.z() / point.p_m.norm()), model.elevations_rad[point.ring], 1e-5);
    }
  }
  EXPECT_EQ(lidar_model("hdl64").elevations_rad.size(), 64U);
}

TEST(SpinningLidar, turns_clockwise_once_a_sweep_starting_behind) {
  const WallAhead setup;
  for (const TestPoint& point : points_of(setup.scan(1.0))) {
    const double azimuth = std::atan2(point.p_m.y(), point.p_m.x());
    const double expected = 3.14159265358979 * (1.0 - 20.0 * static_cast<double>(point.time_s));
    ASSERT_NEAR(azimuth, expected, 1e-4);
  }
}

}  // namespace trigpoint::simulator
