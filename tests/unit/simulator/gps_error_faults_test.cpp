// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Faults that put the position wrong.
#include "faults.hpp"
#include <gtest/gtest.h>

#include <algorithm>

namespace trigpoint::simulator {

namespace {

constexpr int kSeeds = 2000;

Eigen::Vector3d error_at(const Scenario& scenario, double t_s, std::uint64_t seed = 1) {
  return fix_at(scenario, t_s, seed).extra_error_m;
}

}  // namespace

TEST(GpsWrongFix, is_fixed_and_constantly_off_by_a_uniform_distance_in_any_direction) {
  const Scenario scenario = scenario_with_fault("type: gps_wrong_fix, start_s: 5.0");
  double mean_m = 0.0;
  Eigen::Vector2d mean_direction = Eigen::Vector2d::Zero();
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Eigen::Vector3d error = error_at(scenario, 5.0, seed);
    ASSERT_EQ(error_at(scenario, 60.0, seed), error);
    ASSERT_EQ(error.z(), 0.0);
    ASSERT_GE(error.norm(), 0.4);
    ASSERT_LE(error.norm(), 1.6);
    mean_m += error.norm() / kSeeds;
    mean_direction += error.head<2>().normalized() / kSeeds;
  }
  EXPECT_NEAR(mean_m, 1.0, 5.0 * 1.2 / std::sqrt(12.0 * kSeeds));
  EXPECT_LT(mean_direction.norm(), 5.0 / std::sqrt(kSeeds));
  EXPECT_TRUE(error_at(scenario, 4.9).isZero());
}

TEST(GpsWrongFix, takes_a_given_offset_and_calls_a_float_solution_fixed) {
  const Scenario scenario = small_scenario(
      "faults:\n  - {type: gps_class, gnss_class: float}\n"
      "  - {type: gps_wrong_fix, offset_enu_m: [1.0, 0.0, -0.3]}\n");
  EXPECT_EQ(error_at(scenario, 7.0), Eigen::Vector3d(1.0, 0.0, -0.3));
  EXPECT_EQ(fix_at(scenario, 7.0).gnss_class, "fixed");
}

TEST(GpsNlos, stays_constant_for_5_to_15_s_and_has_the_given_sizes) {
  const Scenario scenario = scenario_with_fault("type: gps_nlos");
  constexpr double kStep_s = 0.1;
  double vertical = 0.0;  // of (up / level)^2 over the expected
  int stretches = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Eigen::Vector3d last = error_at(scenario, 0.0, seed);
    double since_s = 0.0;
    for (double t_s = kStep_s; t_s < 300.0; t_s += kStep_s) {
      const Eigen::Vector3d error = error_at(scenario, t_s, seed);
      if (error != last) {
        EXPECT_GT(t_s - since_s, 5.0 - 1.01 * kStep_s);
        EXPECT_LT(t_s - since_s, 15.0 + 1.01 * kStep_s);
        since_s = t_s;
        last = error;
        const double level_m = error.head<2>().norm();
        EXPECT_GE(level_m, 3.0);
        EXPECT_LE(level_m, 12.0);
        vertical += std::pow(error.z() / level_m / 0.8, 2);
        ++stretches;
      }
    }
  }
  EXPECT_NEAR(vertical / stretches, 1.0, variance_tolerance(stretches));
}

TEST(GpsNlos, spares_the_stretches_that_its_share_leaves_out) {
  const Scenario scenario = scenario_with_fault("type: gps_nlos, share: 0.4");
  int wrong = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    wrong += error_at(scenario, 100.0, seed).isZero() ? 0 : 1;
  }
  EXPECT_NEAR(static_cast<double>(wrong) / kSeeds, 0.4, share_tolerance(0.4, kSeeds));
}

TEST(GpsMultipath, ramps_at_its_rate_up_to_its_limit_in_one_direction) {
  const Scenario scenario = scenario_with_fault("type: gps_multipath, start_s: 10.0");
  const Eigen::Vector3d direction = error_at(scenario, 15.0).normalized();
  EXPECT_EQ(direction.z(), 0.0);
  for (const double t_s : {10.0, 12.5, 30.0, 49.9, 50.1, 200.0}) {
    const double size_m = std::min(8.0, 0.2 * (t_s - 10.0));
    EXPECT_LT((error_at(scenario, t_s) - size_m * direction).norm(), 1e-6) << t_s;
  }
  const Scenario given =
      scenario_with_fault("type: gps_multipath, direction_enu: [0.0, 3.0, 4.0], ramp_mps: 1.0");
  EXPECT_LT((error_at(given, 5.0) - Eigen::Vector3d(0.0, 3.0, 4.0)).norm(), 1e-9);
}

TEST(GpsMultipath, wanders_with_the_given_sigma_and_correlation_time) {
  const Scenario scenario = scenario_with_fault(
      "type: gps_multipath, ramp_mps: 0.0, wander_sigma_enu_m: [5.0, 2.0, 1.0], wander_tau_s: "
      "40.0");
  const Eigen::Array3d variance(25.0, 4.0, 1.0);
  constexpr double kLag_s = 20.0;
  Eigen::Array3d measured = Eigen::Array3d::Zero();
  Eigen::Array3d covariance = Eigen::Array3d::Zero();
  double across = 0.0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Eigen::Array3d a = error_at(scenario, 100.0, seed).array();
    const Eigen::Array3d b = error_at(scenario, 100.0 + kLag_s, seed).array();
    measured += a * a / variance / kSeeds;
    covariance += a * b / variance / kSeeds;
    across += a.x() * a.y() / 10.0 / kSeeds;
  }
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(measured[axis], 1.0, variance_tolerance(kSeeds));
    EXPECT_NEAR(covariance[axis], std::exp(-kLag_s / 40.0), variance_tolerance(kSeeds));
  }
  EXPECT_NEAR(across, 0.0, 5.0 / std::sqrt(kSeeds));
}

TEST(GpsSpike, throws_its_share_of_single_fixes_off_each_in_its_own_direction) {
  const Scenario scenario =
      scenario_with_fault("type: gps_spike, share: 0.1, lowest_m: 5.0, highest_m: 700.0");
  constexpr int kFixes = 20000;
  int spikes = 0;
  double mean_m = 0.0;
  Eigen::Vector2d mean_direction = Eigen::Vector2d::Zero();
  for (int i = 0; i < kFixes; ++i) {
    const Eigen::Vector3d error = error_at(scenario, i * kPeriod_s);
    if (!error.isZero()) {
      ++spikes;
      mean_m += error.norm();
      mean_direction += error.head<2>().normalized();
    }
  }
  EXPECT_NEAR(static_cast<double>(spikes) / kFixes, 0.1, share_tolerance(0.1, kFixes));
  EXPECT_NEAR(mean_m / spikes, 352.5, 5.0 * 695.0 / std::sqrt(12.0 * spikes));
  EXPECT_LT(mean_direction.norm() / spikes, 5.0 / std::sqrt(spikes));
}

TEST(GpsSpike, hits_exactly_one_fix_when_it_lasts_one_period) {
  const Scenario scenario = scenario_with_fault(
      "type: gps_spike, start_s: 10.0, duration_s: 0.2, share: 1.0, lowest_m: 15.0, highest_m: "
      "15.0");
  int spikes = 0;
  for (int i = 0; i < 100; ++i) {
    const double size_m = error_at(scenario, 0.06 + i * kPeriod_s).norm();
    EXPECT_TRUE(size_m == 0.0 || std::abs(size_m - 15.0) < 1e-9);
    spikes += size_m > 0.0 ? 1 : 0;
  }
  EXPECT_EQ(spikes, 1);
}

TEST(GpsCluster, is_silent_first_then_agrees_with_itself_far_away_then_is_over) {
  const Scenario scenario = scenario_with_fault(
      "type: gps_cluster, start_s: 10.0, blackout_s: 60.0, cluster_s: 24.0, scatter_m: 2.0");
  EXPECT_FALSE(fix_at(scenario, 9.9).lost);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  constexpr int kFixes = 120;
  for (int i = 0; i < kFixes; ++i) {
    EXPECT_TRUE(fix_at(scenario, 10.0 + 0.5 * i).lost);
    EXPECT_FALSE(fix_at(scenario, 70.0 + i * kPeriod_s).lost);
    mean += error_at(scenario, 70.0 + i * kPeriod_s) / kFixes;
  }
  EXPECT_GT(mean.head<2>().norm(), 699.0);
  EXPECT_LT(mean.head<2>().norm(), 851.0);
  double scatter = 0.0;
  for (int i = 0; i < kFixes; ++i) {
    scatter += (error_at(scenario, 70.0 + i * kPeriod_s) - mean).squaredNorm() / 4.0;
  }
  EXPECT_NEAR(scatter / (3.0 * (kFixes - 1)), 1.0, variance_tolerance(3.0 * kFixes));
  EXPECT_TRUE(error_at(scenario, 94.1).isZero());
  EXPECT_FALSE(fix_at(scenario, 94.1).lost);
}

TEST(GpsHeight, steps_and_drifts_upwards_only) {
  const Scenario scenario = scenario_with_fault(
      "type: gps_height, start_s: 10.0, step_m: 30.0, rate_mps: 0.1, walk_m_per_sqrt_s: 0.0");
  EXPECT_TRUE(error_at(scenario, 9.9).isZero());
  EXPECT_LT((error_at(scenario, 110.0) - Eigen::Vector3d(0.0, 0.0, 40.0)).norm(), 1e-6);
}

TEST(GpsHeight, walks_with_a_variance_that_grows_in_time) {
  const Scenario scenario = scenario_with_fault("type: gps_height, walk_m_per_sqrt_s: 1.5");
  for (const double t_s : {25.0, 400.0}) {
    double variance = 0.0;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      const Eigen::Vector3d error = error_at(scenario, t_s, seed);
      ASSERT_TRUE(error.head<2>().isZero());
      variance += error.z() * error.z() / (1.5 * 1.5 * t_s) / kSeeds;
    }
    EXPECT_NEAR(variance, 1.0, variance_tolerance(kSeeds)) << t_s;
  }
}

TEST(GpsFaults, draw_the_same_again_and_something_else_for_another_seed) {
  for (const std::string type : {"gps_bias, random_horizontal_m: 1.0",
                                 "gps_wrong_fix",
                                 "gps_nlos",
                                 "gps_multipath",
                                 "gps_spike, share: 1.0",
                                 "gps_cluster, blackout_s: 1.0",
                                 "gps_height"}) {
    const Scenario scenario = scenario_with_fault("type: " + type);
    const Eigen::Vector3d first = error_at(scenario, 8.0, 1);
    static_cast<void>(error_at(scenario, 3.0, 1));
    EXPECT_EQ(error_at(scenario, 8.0, 1), first) << type;
    EXPECT_NE(error_at(scenario, 8.0, 2), first) << type;
  }
}

}  // namespace trigpoint::simulator
