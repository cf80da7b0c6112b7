// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "undistortion.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

const Pose kT_base_lidar{from_roll_pitch_yaw({0.1, -0.2, 0.5}), {0.3, -0.1, 1.2}};

/// A hard turn at 20 m/s, IMU at 200 Hz; ends with the sweep.
Path hard_turn() {
  Path path;
  PathNode node;
  node.v_odom_mps = {20.0, 1.0, 0.2};
  node.acceleration_odom_mps2 = {1.0, 6.0, 0.5};
  node.angular_radps = {0.3, -0.4, 2.0};
  for (int i = 0; i <= 20; ++i) {
    path.push_back(node);
    constexpr double kDt_s = 0.005;
    node.stamp_ns += 5'000'000;
    node.T_odom_base.p +=
        kDt_s * node.v_odom_mps + 0.5 * kDt_s * kDt_s * node.acceleration_odom_mps2;
    node.T_odom_base.q = node.T_odom_base.q * so3_exp(kDt_s * node.angular_radps);
    node.v_odom_mps += kDt_s * node.acceleration_odom_mps2;
  }
  return path;
}

Sweep sweep_of(int count) {
  Sweep sweep;
  sweep.end_ns = 100'000'000;
  for (int i = 0; i < count; ++i) {
    const auto share = static_cast<float>(i) / static_cast<float>(count - 1);
    const float azimuth = 6.28F * share;
    const float range = 5.0F + 55.0F * static_cast<float>(i % 7) / 6.0F;
    sweep.points.push_back({range * std::cos(azimuth),
                            range * std::sin(azimuth),
                            range * 0.1F,
                            static_cast<float>(i),
                            0.1F * share});
  }
  return sweep;
}

TEST(Undistortion, agrees_with_interpolating_every_point_exactly) {
  constexpr double kTolerance_m = 1e-4;  // bins of 0.5 ms at 2 rad/s and 60 m, and float
  const Path path = hard_turn();
  const Sweep sweep = sweep_of(5000);
  const PointCloud points = undistort(sweep, path, kT_base_lidar);
  ASSERT_EQ(points.size(), sweep.points.size());
  const Pose T_end_odom = path.at(sweep.end_ns).inverse();
  double worst_m = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TimedPoint& raw = sweep.points[i];
    const Pose T = T_end_odom * path.at(from_seconds(raw.time_s)) * kT_base_lidar;
    const Eigen::Vector3d exact = T * Eigen::Vector3d(raw.x, raw.y, raw.z);
    worst_m = std::max(worst_m, (exact - points[i].position().cast<double>()).norm());
    EXPECT_EQ(points[i].intensity, raw.intensity);
  }
  EXPECT_LT(worst_m, kTolerance_m);
}

TEST(Undistortion, matters) {
  const Path path = hard_turn();
  const Sweep sweep = sweep_of(100);
  const PointCloud points = undistort(sweep, path, kT_base_lidar);
  const Eigen::Vector3d raw_first =
      kT_base_lidar * Eigen::Vector3d(sweep.points[0].x, sweep.points[0].y, sweep.points[0].z);
  EXPECT_GT((points[0].position().cast<double>() - raw_first).norm(), 1.0);
  const TimedPoint& last = sweep.points.back();
  const Eigen::Vector3d raw_last = kT_base_lidar * Eigen::Vector3d(last.x, last.y, last.z);
  EXPECT_LT((points.back().position().cast<double>() - raw_last).norm(), 1e-4);
}

TEST(Undistortion, takes_a_snapshot_whose_points_have_no_duration) {
  Sweep sweep = sweep_of(10);
  sweep.begin_ns = sweep.end_ns;
  for (TimedPoint& point : sweep.points) {
    point.time_s = 0.0F;
  }
  const PointCloud points = undistort(sweep, hard_turn(), kT_base_lidar);
  const Eigen::Vector3d raw =
      kT_base_lidar * Eigen::Vector3d(sweep.points[3].x, sweep.points[3].y, sweep.points[3].z);
  EXPECT_LT((points[3].position().cast<double>() - raw).norm(), 1e-4);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
