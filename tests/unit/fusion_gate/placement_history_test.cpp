// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/placement_history.hpp"

#include "fusion/fused_odometry.hpp"
#include <gtest/gtest.h>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kExactPlacement = 1e-9;

LioStatus at(double at_s, const YawPose& T_map_odom) {
  LioStatus lio;
  lio.stamp_ns = from_seconds(at_s);
  lio.odom_epoch = 4;
  lio.T_map_odom = T_map_odom;
  lio.T_map_odom_covariance = Matrix6d::Identity() * 1e-4;
  return lio;
}

const Eigen::Vector3d kHere{80.0, 30.0, 2.0};

TEST(PlacementHistory, puts_the_robot_where_it_was_put_then) {
  PlacementHistory history{Config{}};
  const YawPose then{0.5, {1.0, 2.0, 3.0}, {0.01, -0.02}};
  history.add(at(10.0, then), 0.0);
  history.add(at(20.0, {0.6, {4.0, 5.0, 6.0}}), 30.0);
  const LioStatus now = at(20.0, {0.6, {4.0, 5.0, 6.0}});
  const auto alignment = history.as_of(from_seconds(15.0), now, kHere, 30.0, false);
  ASSERT_TRUE(alignment);
  EXPECT_TRUE(alignment->replaces);
  EXPECT_EQ(alignment->odom_epoch, 4U);
  EXPECT_NEAR(
      (alignment->T_map_odom.pose() * kHere - then.pose() * kHere).norm(), 0.0, kExactPlacement);
  EXPECT_NEAR(alignment->T_map_odom.yaw_rad, then.yaw_rad, kExactPlacement);
}

TEST(PlacementHistory, changes_nothing_but_the_height_when_only_that_lied) {
  PlacementHistory history{Config{}};
  history.add(at(10.0, {0.5, {1.0, 2.0, 3.0}}), 0.0);
  const LioStatus now = at(20.0, {0.6, {4.0, 5.0, 6.0}});
  const auto alignment = history.as_of(from_seconds(15.0), now, kHere, 30.0, true);
  ASSERT_TRUE(alignment);
  const Eigen::Vector3d placed = alignment->T_map_odom.pose() * kHere;
  const Eigen::Vector3d present = now.T_map_odom.pose() * kHere;
  EXPECT_NEAR((placed - present).head<2>().norm(), 0.0, kExactPlacement);
  EXPECT_NEAR(placed.z(), 5.0, kExactPlacement);
}

TEST(PlacementHistory, knows_nothing_of_before_it_began) {
  PlacementHistory history{Config{}};
  history.add(at(10.0, {}), 0.0);
  EXPECT_FALSE(history.as_of(from_seconds(5.0), at(20.0, {}), kHere, 0.0, false));
}

TEST(PlacementHistory, carries_the_uncertainty_of_the_place_through_the_alignment) {
  const Eigen::Matrix3d here_m2 = Eigen::Vector3d(0.04, 0.09, 0.16).asDiagonal();
  const Alignment alignment = alignment_at(4, 0.7, 1e-4, kHere, {5.0, 6.0, 7.0}, here_m2);
  Odometry point;
  point.T_frame_child.p = kHere;
  point.pose_covariance.setZero();
  const Odometry placed = fuse(point, alignment.T_map_odom, alignment.covariance);
  EXPECT_NEAR(
      (placed.T_frame_child.p - Eigen::Vector3d(5.0, 6.0, 7.0)).norm(), 0.0, kExactPlacement);
  EXPECT_LT((placed.pose_covariance.topLeftCorner<3, 3>() - here_m2).norm(), kExactPlacement);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
