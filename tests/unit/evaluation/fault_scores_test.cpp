// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/fault_scores.hpp"

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

constexpr double kScoreRounding = 1e-9;
constexpr double kStampRounding = 1e-9;  // s

/// A drive along x at `step_m` a pose whose estimate is off by `error_m(i)` along y.
template <typename ErrorOf>
std::vector<PosePair> pairs_with(int poses, double step_m, const ErrorOf& error_m) {
  std::vector<PosePair> pairs;
  const Trajectory reference = straight(poses, step_m);
  for (int i = 0; i < poses; ++i) {
    const auto& at = reference[static_cast<std::size_t>(i)];
    Pose estimate = at.pose;
    estimate.p.y() += error_m(i);
    pairs.push_back({at.stamp_ns, estimate, at.pose});
  }
  return pairs;
}

Nanoseconds stamp(int i) {
  return kStart_ns + i * kStep_ns;
}

TEST(ErrorInside, looks_at_the_windows_only) {
  const auto pairs = pairs_with(40, 1.0, [](int i) {
    return i == 5 ? 9.0 : i == 20 ? -3.0 : i == 21 ? 4.0 : 0.0;
  });
  const std::vector<Window> windows{{stamp(19), stamp(22)}, {stamp(30), stamp(33)}};
  EXPECT_NEAR(*worst_error_m(pairs, windows), 4.0, kScoreRounding);
  EXPECT_NEAR(*rms_error_m(pairs, windows), std::sqrt(25.0 / 4.0), kScoreRounding);
  EXPECT_FALSE(worst_error_m(pairs, {{0, 1}}));
  EXPECT_FALSE(rms_error_m(pairs, {}));
}

TEST(TimeToReturn, is_when_an_error_that_falls_at_a_known_rate_has_reached_the_limit) {
  // 0.8 m at pose 20, 0.03 m less at each of the next: |e| <= 0.1 first after 24 poses (0.08 m).
  const auto pairs =
      pairs_with(80, 1.0, [](int i) { return std::max(0.0, 0.8 - 0.03 * std::max(0, i - 20)); });
  EXPECT_NEAR(*time_to_return_s(pairs, stamp(20), 0.1), 2.4, kStampRounding);
}

TEST(TimeToReturn, does_not_take_a_passage_for_a_return) {
  // Inside from pose 10 to 15 (half a second), and for good from 30 on.
  const auto pairs =
      pairs_with(60, 1.0, [](int i) { return (i >= 10 && i < 15) || i >= 30 ? 0.0 : 1.0; });
  EXPECT_NEAR(*time_to_return_s(pairs, stamp(0), 0.1), 3.0, kStampRounding);
  EXPECT_NEAR(*time_to_return_s(pairs, stamp(0), 0.1, kStep_ns), 1.0, kStampRounding);
}

TEST(TimeToReturn, is_zero_without_an_error_and_none_where_it_stays) {
  EXPECT_EQ(time_to_return_s(pairs_with(30, 1.0, [](int) { return 0.0; }), stamp(5), 0.1), 0.0);
  EXPECT_FALSE(time_to_return_s(pairs_with(30, 1.0, [](int) { return 0.2; }), stamp(5), 0.1));
}

TEST(TimeToReturn, does_not_look_beyond_the_hold) {
  const auto pairs = pairs_with(60, 1.0, [](int i) { return i < 25 ? 0.0 : 5.0; });
  EXPECT_EQ(time_to_return_s(pairs, stamp(5), 0.1), 0.0);
}

TEST(ExcessOverDistance, is_what_the_error_has_more_than_its_share_of_the_way) {
  // From pose 10 on 2 m a pose; error 0.5 m at pose 15: 10 m driven since.
  const auto pairs = pairs_with(40, 2.0, [](int i) { return i == 15 ? -0.5 : i == 3 ? 7.0 : 0.0; });
  EXPECT_NEAR(*excess_over_distance_m(pairs, stamp(10), 1, 0.003), 0.5 - 0.03, kScoreRounding);
  EXPECT_NEAR(*excess_over_distance_m(pairs, stamp(10), 2, 0.003), 0.0, kScoreRounding);
  EXPECT_NEAR(*excess_over_distance_m(pairs, stamp(16), 1, 0.003), 0.0, kScoreRounding);
  EXPECT_FALSE(excess_over_distance_m(pairs, stamp(41), 1, 0.003));
}

TEST(GateClosing, counts_what_was_used_and_until_when) {
  const GateClosing closing = gate_closing({{stamp(0), true},
                                            {stamp(2), false},
                                            {stamp(4), false},
                                            {stamp(6), true},
                                            {stamp(8), false}});
  EXPECT_EQ(closing.delivered, 5U);
  EXPECT_EQ(closing.used, 2U);
  EXPECT_NEAR(closing.last_used_s, 0.6, kStampRounding);
  EXPECT_EQ(gate_closing({{stamp(0), false}}).used, 0U);
  EXPECT_EQ(gate_closing({}).delivered, 0U);
}

TEST(LargestDifference, leaves_out_the_windows_and_what_the_other_does_not_cover) {
  const Trajectory reference = straight(30, 1.0);
  Trajectory other = straight(40, 1.0);
  other[10].pose.p.z() += 3.0;
  other[12].pose.p.z() -= 0.25;
  other[35].pose.p.z() += 9.0;
  EXPECT_NEAR(*largest_difference_m(other, reference, {}), 3.0, kScoreRounding);
  EXPECT_NEAR(
      *largest_difference_m(other, reference, {{stamp(9), stamp(11)}}), 0.25, kScoreRounding);
  EXPECT_FALSE(largest_difference_m(other, straight(5, 1.0, stamp(100)), {}));
}

TEST(LargestStepOver, sums_a_correction_that_is_handed_over_slowly) {
  // 1 cm more than odom at each of 20 poses in a turned map: 5 cm over half a second.
  const Trajectory odom = helix(100);
  const Pose T_map_odom(from_yaw(2.0), {9.0, 8.0, 7.0});
  Trajectory fused = transformed(T_map_odom, odom);
  for (int i = 0; i < 100; ++i) {
    fused[static_cast<std::size_t>(i)].pose.p.x() += 0.01 * std::clamp(i - 40, 0, 20);
  }
  EXPECT_NEAR(largest_step_over(fused, odom, kStep_ns).distance_m, 0.01, kScoreRounding);
  EXPECT_NEAR(largest_step_over(fused, odom, 5 * kStep_ns).distance_m, 0.05, kScoreRounding);
  EXPECT_NEAR(largest_step_over(fused, odom, 50 * kStep_ns).distance_m, 0.2, kScoreRounding);
  EXPECT_EQ(largest_step_over(fused, odom, 5 * kStep_ns).intervals, 95U);
  EXPECT_NEAR(largest_step_over(transformed(T_map_odom, odom), odom, kStep_ns).distance_m,
              0.0,
              kScoreRounding);
}

TEST(LargestStepOver, does_not_count_the_length_of_a_gap) {
  const Trajectory odom = straight(60, 1.0);
  Trajectory fused = odom;
  for (std::size_t i = 30; i < fused.size(); ++i) {
    fused[i].pose.p.y() += 1.0;
  }
  fused.erase(fused.begin() + 25, fused.begin() + 35);
  EXPECT_NEAR(largest_step_over(fused, odom, kStep_ns).distance_m, 0.0, kScoreRounding);
}

TEST(Nees, is_the_squared_error_in_sigmas_per_degree_of_freedom) {
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal() << 0.01, 0.04, 0.09, 1e-4, 4e-4, 9e-4;
  const Pose reference(from_roll_pitch_yaw({0.1, -0.2, 2.0}), {5.0, 6.0, 7.0});
  // Two sigmas off along y, one sigma of roll about the parent's x axis.
  const Pose estimate(so3_exp({0.01, 0.0, 0.0}) * reference.q,
                      reference.p + Eigen::Vector3d(0.0, 0.4, 0.0));
  const Nees nees = nees_of(estimate, covariance, reference);
  EXPECT_NEAR(nees.position, 4.0 / 3.0, 1e-9);
  EXPECT_NEAR(nees.pose, 5.0 / 6.0, 1e-9);
  EXPECT_TRUE(std::isnan(nees_of(estimate, -covariance, reference).pose));
}

}  // namespace
}  // namespace trigpoint::evaluation
