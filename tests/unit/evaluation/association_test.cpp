// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "made_trajectories.hpp"
#include <gtest/gtest.h>

namespace trigpoint::evaluation {
namespace {

using test::kStart_ns;
using test::kStep_ns;
using test::straight;

constexpr double kRounding_m = 1e-9;

TEST(Association, interpolates_the_reference_at_the_estimates_stamps) {
  const auto reference = straight(11, 1.0);
  const auto estimate = straight(5, 1.0, kStart_ns + 25'000'000);
  const auto result = associate(estimate, reference);
  ASSERT_EQ(result.pairs.size(), 5U);
  EXPECT_NEAR(result.pairs[0].reference.p.x(), 0.25, kRounding_m);
  EXPECT_NEAR(result.pairs[4].reference.p.x(), 4.25, kRounding_m);
}

TEST(Association, interpolates_rotations_half_way) {
  Trajectory reference{{0, Pose(from_yaw(0.2), Eigen::Vector3d::Zero())},
                       {kStep_ns, Pose(from_yaw(0.6), Eigen::Vector3d::Zero())}};
  const auto pose = pose_at(reference, kStep_ns / 2);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(yaw_of(pose->q), 0.4, kRounding_m);
}

TEST(Association, does_not_extrapolate) {
  const auto reference = straight(3, 1.0);
  EXPECT_FALSE(pose_at(reference, kStart_ns - 1));
  EXPECT_FALSE(pose_at(reference, kStart_ns + 2 * kStep_ns + 1));
  EXPECT_TRUE(pose_at(reference, kStart_ns));
  EXPECT_TRUE(pose_at(reference, kStart_ns + 2 * kStep_ns));
}

TEST(Association, does_not_bridge_a_gap_of_the_reference) {
  Trajectory reference = straight(20, 1.0);
  reference.erase(reference.begin() + 5, reference.begin() + 10);  // 0.6 s between neighbours
  const auto result = associate(straight(20, 1.0), reference);
  EXPECT_EQ(result.pairs.size(), 15U);
}

TEST(Association, tells_coverage_from_the_first_pose_and_of_the_whole) {
  const auto reference = straight(100, 1.0);
  Trajectory estimate = straight(100, 1.0);
  estimate.erase(estimate.begin(), estimate.begin() + 50);  // aligned late
  estimate.resize(25);                                      // and died early
  const auto coverage = associate(estimate, reference).coverage;
  // One more reference pose on each free side lies within the gap of 0.1 s.
  EXPECT_NEAR(coverage.whole, 27.0 / 100.0, kRounding_m);
  EXPECT_NEAR(coverage.from_first, 26.0 / 50.0, kRounding_m);
}

TEST(Association, of_nothing_has_no_pairs_and_no_coverage) {
  EXPECT_TRUE(associate({}, straight(3, 1.0)).pairs.empty());
  EXPECT_TRUE(associate(straight(3, 1.0), {}).pairs.empty());
  EXPECT_EQ(associate({}, straight(3, 1.0)).coverage.whole, 0.0);
}

}  // namespace
}  // namespace trigpoint::evaluation
