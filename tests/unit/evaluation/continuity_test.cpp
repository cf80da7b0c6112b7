// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/continuity.hpp"

#include "made_trajectories.hpp"
#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::evaluation {
namespace {

using test::helix;
using test::kStart_ns;
using test::kStep_ns;
using test::straight;
using test::transformed;

constexpr double kRounding = 1e-9;
constexpr Nanoseconds kSecond_ns = kNanosecondsPerSecond;

TEST(LargestStep, against_the_lio_is_none_when_only_the_frame_differs) {
  const auto lio = helix(100);
  const auto step = largest_step(transformed(Pose(from_yaw(2.0), {9.0, 8.0, 7.0}), lio), lio);
  EXPECT_TRUE(step.relative_to_lio);
  EXPECT_EQ(step.intervals, 99U);
  EXPECT_NEAR(step.distance_m, 0.0, 1e-9);
}

TEST(LargestStep, against_the_lio_is_what_fused_moved_more_than_the_lio) {
  const auto lio = straight(50, 1.0);  // moves 1 m a pose itself
  Trajectory fused = transformed(Pose(from_yaw(1.0), {5.0, 0.0, 0.0}), lio);
  for (std::size_t i = 30; i < fused.size(); ++i) {
    fused[i].pose.p += Eigen::Vector3d(0.3, 0.0, -0.4);
  }
  const auto step = largest_step(fused, lio);
  EXPECT_NEAR(step.distance_m, 0.5, kRounding);
  EXPECT_EQ(step.stamp_ns, kStart_ns + 30 * kStep_ns);
}

TEST(LargestStep, at_base_link_includes_the_lever_of_a_turned_alignment) {
  // T_map_odom turns by 0.01 rad about odom's origin when the vehicle is 100 m away.
  const auto lio = straight(2, 100.0);
  Trajectory fused = lio;
  fused[1].pose = Pose(from_yaw(0.01), Eigen::Vector3d::Zero()) * lio[1].pose;
  EXPECT_NEAR(largest_step(fused, lio).distance_m, 2.0 * 100.0 * std::sin(0.005), kRounding);
}

TEST(LargestStep, without_lio_is_the_plain_change) {
  const auto step = largest_step(straight(10, 1.5));
  EXPECT_FALSE(step.relative_to_lio);
  EXPECT_NEAR(step.distance_m, 1.5, kRounding);
}

TEST(Outages, are_gaps_longer_than_the_limit_and_the_silence_at_the_end) {
  const std::vector<Nanoseconds> fixes{
      10 * kSecond_ns, 11 * kSecond_ns, 13 * kSecond_ns, 20 * kSecond_ns};
  const auto windows = find_outages(fixes, 25 * kSecond_ns);
  ASSERT_EQ(windows.size(), 2U);  // 2 s is not longer than 2 s
  EXPECT_EQ(windows[0].begin_ns, 13 * kSecond_ns);
  EXPECT_EQ(windows[0].end_ns, 20 * kSecond_ns);
  EXPECT_EQ(windows[1].end_ns, 25 * kSecond_ns);
  EXPECT_TRUE(find_outages({}, 25 * kSecond_ns).empty());
}

TEST(OutageErrors, tell_begin_largest_and_end_of_each_window) {
  const auto reference = straight(60, 1.0);
  Trajectory estimate = reference;
  const auto offset = [&](std::size_t i, double y_m) { estimate[i].pose.p.y() = y_m; };
  offset(21, 0.1);
  offset(25, -0.9);
  offset(29, 0.4);
  offset(40, 5.0);  // outside
  const Window window{kStart_ns + 20 * kStep_ns, kStart_ns + 30 * kStep_ns};
  const auto errors =
      outage_errors(associate(estimate, reference).pairs, {window, {0, kSecond_ns}});
  ASSERT_EQ(errors.size(), 2U);
  EXPECT_EQ(errors[0].pairs, 9U);
  EXPECT_NEAR(errors[0].begin_m, 0.1, kRounding);
  EXPECT_NEAR(errors[0].max_m, 0.9, kRounding);
  EXPECT_NEAR(errors[0].end_m, 0.4, kRounding);
  EXPECT_NEAR(errors[0].distance_m, 8.0, kRounding);  // nine poses, 1 m apart
  EXPECT_TRUE(std::isnan(errors[1].max_m));
}

}  // namespace
}  // namespace trigpoint::evaluation
