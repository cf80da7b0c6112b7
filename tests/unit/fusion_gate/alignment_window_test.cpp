// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/alignment_window.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::fusion_gate {
namespace {

const YawPose kTruth{2.0, {100.0, 50.0, 5.0}};

AlignmentPair pair_at(double distance_m, double speed_mps = 1.2) {
  AlignmentPair pair;
  pair.stamp_ns = from_seconds(distance_m / speed_mps);
  pair.p_odom_m = {distance_m, 0.1 * distance_m, 0.0};
  pair.p_map_m = kTruth.pose() * pair.p_odom_m;
  pair.variance_map_m2.setConstant(4e-4);
  pair.distance_m = distance_m;
  return pair;
}

TEST(AlignmentWindow, admits_within_ten_metres_of_good_fixes) {
  AlignmentWindow window({});
  double distance_m = 0.0;
  while (!window.admitted() && distance_m < 30.0) {
    window.add(pair_at(distance_m));
    distance_m += 0.3;
  }
  EXPECT_TRUE(window.admitted());
  EXPECT_GT(distance_m, 5.0);
  EXPECT_LT(distance_m, 10.0);
}

TEST(AlignmentWindow, refuses_pairs_of_a_robot_at_rest_and_stamps_that_go_back) {
  AlignmentWindow window({});
  EXPECT_TRUE(window.add(pair_at(1.0)));
  EXPECT_FALSE(window.add(pair_at(1.1)));
  EXPECT_FALSE(window.add(pair_at(1.0)));
  EXPECT_FALSE(window.add(pair_at(0.2)));
  AlignmentPair later = pair_at(1.0);
  later.stamp_ns += 3 * kNanosecondsPerSecond;
  EXPECT_TRUE(window.add(later));
}

TEST(AlignmentWindow, recovers_soon_after_a_wrong_stretch_at_the_start) {
  AlignmentWindow window({});
  constexpr double kWrongUntil_m = 30.0;
  double distance_m = 0.0;
  for (; distance_m < kWrongUntil_m; distance_m += 0.3) {
    AlignmentPair pair = pair_at(distance_m);
    pair.p_map_m += Eigen::Vector3d(0.1 * distance_m, 3.0 * std::sin(distance_m), 0.0);  // wanders
    window.add(pair);
    EXPECT_FALSE(window.admitted()) << distance_m;
  }
  while (!window.admitted() && distance_m < 100.0) {
    window.add(pair_at(distance_m));
    distance_m += 0.3;
  }
  EXPECT_LT(distance_m, kWrongUntil_m + 20.0);
  EXPECT_NEAR(window.solution()->T_map_odom.yaw_rad, kTruth.yaw_rad, 0.02);
  EXPECT_LT((window.solution()->T_map_odom.pose() * pair_at(distance_m).p_odom_m -
             pair_at(distance_m).p_map_m)
                .norm(),
            0.2);
}

TEST(AlignmentWindow, stays_bounded_on_a_long_drive) {
  AlignmentConfig config;
  config.max_yaw_sigma_rad = 1e-4;  // never admitted
  config.max_pairs = 40;
  AlignmentWindow window(config);
  for (double distance_m = 0.0; distance_m < 500.0; distance_m += 0.3) {
    window.add(pair_at(distance_m));
    ASSERT_LE(window.solution()->pairs, 40U);
  }
  EXPECT_LT(window.solution()->baseline_m, 1.1 * config.window_m);
}

TEST(AlignmentWindow, counts_what_lio_may_have_slid) {
  AlignmentWindow held({});
  AlignmentWindow slid({});
  for (double distance_m = 0.0; distance_m < 30.0; distance_m += 0.5) {
    const double sigma_m = 0.2 * distance_m;  // scans do not hold x
    held.on_lio(Eigen::Vector3d::Constant(2.5e-5), 0.5);
    slid.on_lio({sigma_m * sigma_m, 2.5e-5, 2.5e-5}, 0.5);
    held.add(pair_at(distance_m));
    slid.add(pair_at(distance_m));
  }
  EXPECT_LT(held.solution()->yaw_sigma_rad(), 0.01);
  // odom's x lies 2 rad from east: both axes of map have their share.
  EXPECT_GT(slid.solution()->yaw_sigma_rad(), 3.0 * held.solution()->yaw_sigma_rad());
}

TEST(AlignmentWindow, begins_anew_when_cleared) {
  AlignmentWindow window({});
  window.add(pair_at(1.0));
  window.clear();
  EXPECT_FALSE(window.solution());
  EXPECT_EQ(window.obstacle(), "no matched fix yet");
}

}  // namespace
}  // namespace trigpoint::fusion_gate
