// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/rows.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::fusion_gate {
namespace {

AcceptedFix row_fix_at(double stamp_s, double sigma_m = 0.1) {
  return {from_seconds(stamp_s), {1.0, 2.0, 3.0}, Eigen::Matrix3d::Identity() * sigma_m * sigma_m};
}

const Eigen::Vector3d kLever_m{0.1, 0.2, 0.8};
const Eigen::Vector3d kThreshold_m{0.5, 0.5, 1.0};

AxisChoices all_fused() {
  return choose_axes(Mode::kFusion, Eigen::Vector3d::Ones(), kThreshold_m);
}

TEST(Rows, carry_the_fix_the_lever_arm_and_the_decisions) {
  RowMaker maker({}, kLever_m);
  const StateUpdate update =
      maker.make(row_fix_at(10.0), choose_axes(Mode::kHard, {0.01, 4.0, 0.01}, kThreshold_m));
  EXPECT_EQ(update.fix_stamp_ns, from_seconds(10.0));
  EXPECT_EQ(update.position_map_m, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(update.lever_arm_base_m, kLever_m);
  EXPECT_EQ(update.mode, UpdateMode::kRows);
  EXPECT_EQ(update.decision[0], AxisDecision::kFused);
  EXPECT_EQ(update.decision[1], AxisDecision::kLio);
  EXPECT_FALSE(update.first_alignment);
}

TEST(Rows, overwrite_in_mode_literal) {
  Config config;
  config.mode = "literal";
  EXPECT_EQ(RowMaker(config, kLever_m).make(row_fix_at(1.0), all_fused()).mode,
            UpdateMode::kOverwrite);
}

TEST(Rows, are_never_better_than_the_floor) {
  RowMaker maker({}, kLever_m);
  const StateUpdate update = maker.make(row_fix_at(1.0, 1e-4), all_fused());
  EXPECT_NEAR(std::sqrt(update.covariance_map_m2(0, 0)), 0.02, 1e-12);
}

TEST(Rows, grow_with_the_correlation_of_gps_errors_up_to_the_cap) {
  Config config;
  config.gps_correlation_time_s = 5.0;
  config.max_inflation = 60.0;
  RowMaker maker(config, kLever_m);
  EXPECT_NEAR(maker.make(row_fix_at(1.0), all_fused()).covariance_map_m2(0, 0), 0.01, 1e-12);
  EXPECT_NEAR(maker.make(row_fix_at(1.2), all_fused()).covariance_map_m2(0, 0), 0.01 * 51.0, 1e-9);
  EXPECT_NEAR(maker.make(row_fix_at(2.2), all_fused()).covariance_map_m2(0, 0), 0.01 * 11.0, 1e-9);
  EXPECT_NEAR(maker.make(row_fix_at(2.25), all_fused()).covariance_map_m2(0, 0), 0.01 * 60.0, 1e-9);
}

TEST(Rows, that_enter_no_axis_do_not_count_as_the_last_row) {
  RowMaker maker({}, kLever_m);
  maker.make(row_fix_at(1.0), choose_axes(Mode::kHard, {9.0, 9.0, 9.0}, kThreshold_m));
  EXPECT_EQ(maker.inflation(from_seconds(1.2)), 1.0);
}

TEST(Rows, weigh_together_what_correlated_errors_are_worth) {
  // The mean of n correlated errors by Monte-Carlo against what n inflated rows claim.
  constexpr double kTau_s = 5.0;
  constexpr double kInterval_s = 0.2;
  constexpr int kRows = 500;  // 100 s, far longer than tau
  constexpr int kRuns = 400;
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  const double rho = std::exp(-kInterval_s / kTau_s);
  double variance = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    double error = normal(generator);
    double sum = 0.0;
    for (int k = 0; k < kRows; ++k) {
      sum += error;
      error = rho * error + std::sqrt(1.0 - rho * rho) * normal(generator);
    }
    variance += sum / kRows * (sum / kRows) / kRuns;
  }
  Config config;
  config.gps_correlation_time_s = kTau_s;
  RowMaker maker(config, kLever_m);
  maker.make(row_fix_at(0.0), all_fused());
  const double claimed = maker.inflation(from_seconds(kInterval_s)) / kRows;
  EXPECT_NEAR(variance / claimed, 1.0, 0.2);  // 400 runs know a variance to 7 %
}

}  // namespace
}  // namespace trigpoint::fusion_gate
