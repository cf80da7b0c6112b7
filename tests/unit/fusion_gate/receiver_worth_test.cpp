// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/receiver_worth.hpp"

#include "lying_drive.hpp"
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <random>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kCoarse_m2 = 1.0;   // as measured
constexpr double kSaid_m2 = 0.09;    // by the same solution
constexpr double kBetter_m2 = 4e-4;  // what the next one says
constexpr double kYaw_rad = 0.7;

using Error = std::function<Eigen::Vector2d(double)>;

/// Fixes of a robot that drives straight on from `from_m` to `to_m`, every 0.2 m.
void drive(ReceiverWorth& worth, double said_m2, double from_m, double to_m, const Error& error) {
  for (double at_m = from_m; at_m < to_m; at_m += 0.2) {
    const Eigen::Vector2d odom_m(at_m, 0.3 * at_m);
    const Eigen::Vector2d map_m = Eigen::Rotation2Dd(kYaw_rad) * odom_m;
    worth.add(said_m2, map_m + error(at_m), odom_m, kYaw_rad);
  }
}

Error white(double sigma_m) {
  return [=, random = std::mt19937(1)](double) mutable -> Eigen::Vector2d {
    std::normal_distribution<double> normal(0.0, sigma_m);
    return {5.0 + normal(random), normal(random)};
  };
}

TEST(ReceiverWorth, is_what_the_alignment_measured_until_a_better_solution_is_measured) {
  ReceiverWorth worth{Config{}};
  EXPECT_EQ(worth.least_m2(kSaid_m2), 0.0);
  worth.on_alignment(kSaid_m2, kCoarse_m2);
  EXPECT_EQ(worth.least_m2(kSaid_m2), kCoarse_m2);
  EXPECT_EQ(worth.least_m2(kBetter_m2), kCoarse_m2) << "a claim alone is nothing";
  drive(worth, kBetter_m2, 0.0, 4.0, white(0.01));
  EXPECT_EQ(worth.least_m2(kBetter_m2), kCoarse_m2) << "not over the baseline";
  drive(worth, kBetter_m2, 4.0, 8.0, white(0.01));
  EXPECT_EQ(worth.least_m2(kBetter_m2), 0.0);
  EXPECT_EQ(worth.least_m2(kSaid_m2), kCoarse_m2) << "of the solution of before";
  EXPECT_EQ(worth.least_m2(0.1 * kBetter_m2), 0.0);
}

TEST(ReceiverWorth, is_measured_for_each_kind_of_solution) {
  ReceiverWorth worth{Config{}};
  constexpr double kFloat_m2 = 0.01;
  worth.on_alignment(kSaid_m2, kCoarse_m2);
  drive(worth, kBetter_m2, 0.0, 8.0, white(0.01));
  EXPECT_EQ(worth.least_m2(kFloat_m2), kCoarse_m2);
  drive(worth, kFloat_m2, 8.0, 16.0, white(0.3));
  EXPECT_NEAR(worth.least_m2(kFloat_m2), 0.09, 0.06);
  EXPECT_EQ(worth.least_m2(kBetter_m2), 0.0);
  EXPECT_EQ(worth.least_m2(kSaid_m2), kCoarse_m2);
}

TEST(ReceiverWorth, of_a_claim_that_its_own_fixes_contradict_stays) {
  ReceiverWorth worth{Config{}};
  worth.on_alignment(kSaid_m2, kCoarse_m2);
  drive(worth, kBetter_m2, 0.0, 20.0, white(1.0));
  EXPECT_GT(worth.least_m2(kBetter_m2), 0.4 * kCoarse_m2);
  EXPECT_LE(worth.least_m2(kBetter_m2), kCoarse_m2);
}

TEST(ReceiverWorth, is_not_measured_at_rest_nor_over_a_way_that_lio_does_not_know) {
  ReceiverWorth worth{Config{}};
  worth.on_alignment(kSaid_m2, kCoarse_m2);
  for (int fix = 0; fix < 100; ++fix) {
    worth.add(kBetter_m2, {1.0, 2.0}, {0.0, 0.0}, kYaw_rad);
  }
  EXPECT_EQ(worth.least_m2(kBetter_m2), kCoarse_m2);
  drive(worth, kBetter_m2, 0.0, 4.0, white(0.01));
  worth.forget_way();
  drive(worth, kBetter_m2, 4.0, 8.0, white(0.01));
  EXPECT_EQ(worth.least_m2(kBetter_m2), kCoarse_m2);
}

LyingDriveSettings smoothly(std::uint64_t seed) {
  LyingDriveSettings settings;
  settings.seed = seed;
  settings.config.mode = "smooth";
  return settings;
}

/// A receiver on a grid of 0.3 m that claims a centimetre, smoothed by its filter.
TEST(ReceiverWorth, keeps_coarse_fixes_in_use_that_the_alignment_measured) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    LyingDriveSettings settings = smoothly(seed);
    settings.raw_grid_m = 0.3;
    LyingDrive drive(settings);
    drive.run();
    EXPECT_GT(drive.share_used(0, 20.0, 149.0), 0.95);
    EXPECT_LT(drive.worst(0, 1), 0.3);
  }
}

/// It goes on so, and claims a millimetre.
TEST(ReceiverWorth, does_not_follow_a_claim_that_is_contradicted) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    LyingDriveSettings settings = smoothly(seed);
    settings.raw_grid_m = 0.3;
    settings.claimed_share = [](double at_s) { return at_s < 60.0 ? 1.0 : 0.1; };
    LyingDrive drive(settings);
    drive.run();
    EXPECT_GT(drive.share_used(0, 20.0, 149.0), 0.95);
    EXPECT_LT(drive.worst(0, 1), 0.3);
  }
}

/// Nearly a metre at the start, a centimetre after 60 s; then the receiver lies by half a metre,
/// and the filter does not show it.
TEST(ReceiverWorth, follows_a_receiver_that_has_become_better) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    LyingDriveSettings settings = smoothly(seed);
    settings.claimed_sigma_m = 0.2;
    settings.claimed_share = [](double at_s) { return at_s < 60.0 ? 1.0 : 0.05; };
    settings.raw_lie_enu_m = [random = std::mt19937_64(seed)](double at_s) mutable {
      std::normal_distribution<double> normal(0.0, at_s < 60.0 ? 0.8 : 0.01);
      const double lie_m = at_s > 120.0 ? 0.5 : 0.0;
      return Eigen::Vector3d(normal(random), normal(random) + lie_m, 0.0);
    };
    LyingDrive drive(settings);
    drive.run();
    EXPECT_GT(drive.share_used(0, 95.0, 120.0), 0.95);
    EXPECT_EQ(drive.share_used(0, 120.5, 130.0), 0.0);
    EXPECT_LT(drive.worst(0, 1, 70.0, 120.0), 0.2);
  }
}

TEST(ReceiverWorth, is_what_it_says_where_the_alignment_found_no_more) {
  ReceiverWorth worth{Config{}};
  worth.on_alignment(kSaid_m2, 0.5 * kSaid_m2);
  EXPECT_EQ(worth.least_m2(kSaid_m2), 0.0);
}

/// Positions by code that claim 0.15 m and scatter by a metre, of which the filter knows; from 60 s
/// on RTK. Once nothing was measured of a receiver whose filter had found it out: its fixes were
/// held against its claim, and doubted.
LyingDriveSettings code_before_rtk(std::uint64_t seed) {
  LyingDriveSettings settings = smoothly(seed);
  settings.config.threshold = {2.0, 2.0, 4.0};
  settings.claimed_sigma_m = 0.15;
  settings.claimed_share = [](double at_s) { return at_s < 60.0 ? 1.0 : 0.1; };
  settings.filter_sigma_m = [](double at_s) { return at_s < 60.0 ? 1.2 : 0.03; };
  settings.lie_enu_m = [random = std::mt19937_64(seed)](double at_s) mutable {
    std::normal_distribution<double> normal(0.0, at_s < 60.0 ? 1.0 : 0.01);
    return Eigen::Vector3d(normal(random), normal(random), 0.0);
  };
  return settings;
}

TEST(ReceiverWorth, is_measured_although_the_filter_knows_of_it) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    LyingDrive drive(code_before_rtk(seed));
    drive.run();
    std::printf("seed %d: used %.2f, of RTK %.2f; %.2f m off before it, %.2f m after 30 s of it\n",
                static_cast<int>(seed),
                drive.share_used(0, 35.0, 60.0),
                drive.share_used(0, 70.0, 149.0),
                drive.worst(0, 1, 55.0, 60.0),
                drive.worst(0, 1, 90.0));
    EXPECT_GT(drive.share_used(0, 35.0, 60.0), 0.8);
    EXPECT_GT(drive.share_used(0, 70.0, 149.0), 0.9);
    EXPECT_LT(drive.worst(0, 1, 90.0), 0.2);
  }
}

}  // namespace
}  // namespace trigpoint::fusion_gate
