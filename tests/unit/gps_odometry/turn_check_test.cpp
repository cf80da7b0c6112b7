// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "turn_check.hpp"

#include "drive.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <string>

namespace trigpoint::gps_odometry {
namespace {

/// What a drive through town says about a gyro that reads `factor` times the truth.
std::set<std::string> reasons(double factor, const Profile& profile, double sigma_m) {
  const auto truth = drive(profile, 150.0);
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal(0.0, sigma_m);
  TurnCheck check;
  std::set<std::string> found;
  for (std::size_t i = 0; i < truth.size(); i += 10) {
    const Truth& now = truth[i];
    check.add_imu(stamp_of(now.time_s),
                  {0.0, 0.0, factor * now.yaw_rate_radps},
                  Eigen::Vector3d::UnitZ() * 9.8);
    if (i % 200 == 0) {
      const Eigen::Vector2d fix =
          now.position_map_m.head<2>() + Eigen::Vector2d(normal(random), normal(random));
      found.insert(check.add_fix(stamp_of(now.time_s), fix, sigma_m).reason);
    }
  }
  found.erase("");
  return found;
}

TEST(TurnCheck, is_content_with_a_good_gyro) {
  for (const double sigma_m : {0.02, 0.5, 3.0}) {
    EXPECT_TRUE(reasons(1.0, town(1.5, 3.0), sigma_m).empty());
    EXPECT_TRUE(reasons(1.0, errands(5.0, 3.0), sigma_m).empty());
    EXPECT_TRUE(reasons(1.0, reverse_start(1.5, 3.0), sigma_m).empty());
  }
}

TEST(TurnCheck, is_content_with_quarter_turns_between_forward_and_reverse) {
  constexpr double kStep_s = 0.01;
  constexpr double kSide_s = 10.0;  // at 1 m/s
  constexpr double kTurn_s = 2.0;
  TurnCheck check;
  Eigen::Vector2d position_m(0.0, 0.0);
  double yaw_rad = 0.0;
  for (int i = 0; i < 10'000; ++i) {
    const double in_cycle_s = std::fmod(kStep_s * i, kSide_s + kTurn_s);
    const bool turning = in_cycle_s >= kSide_s;
    const bool reverse = static_cast<int>(kStep_s * i / (kSide_s + kTurn_s)) % 2 == 1;
    const double rate_radps = turning ? std::numbers::pi / 2.0 / kTurn_s : 0.0;
    const double speed_mps = turning ? 0.0 : (reverse ? -1.0 : 1.0);
    yaw_rad += kStep_s * rate_radps;
    position_m += kStep_s * speed_mps * Eigen::Vector2d(std::cos(yaw_rad), std::sin(yaw_rad));
    check.add_imu(stamp_of(kStep_s * i), {0.0, 0.0, rate_radps}, Eigen::Vector3d::UnitZ() * 9.8);
    if (i % 20 == 0) {
      ASSERT_EQ(check.add_fix(stamp_of(kStep_s * i), position_m, 0.02).reason, "") << kStep_s * i;
    }
  }
}

TEST(TurnCheck, finds_a_wrong_sign) {
  EXPECT_EQ(reasons(-1.0, town(1.5, 3.0), 0.02), std::set<std::string>{"imu_gyro_sign"});
}

TEST(TurnCheck, leaves_the_unit_to_the_check_of_units) {
  EXPECT_TRUE(reasons(57.2958, town(1.5, 3.0), 0.02).empty());
}

TEST(TurnCheck, says_nothing_about_a_gyro_that_does_not_turn) {
  EXPECT_TRUE(reasons(0.0, town(1.5, 3.0), 0.02).empty());
}

}  // namespace
}  // namespace trigpoint::gps_odometry
