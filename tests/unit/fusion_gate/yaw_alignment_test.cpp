// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/yaw_alignment.hpp"

#include "trigpoint/base/so3.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kDegree_rad = 0.017453292519943295;
const YawPose kTrueAlignment{170.0 * kDegree_rad, {12.0, -7.0, 3.0}};

struct Drive {
  int fixes{40};
  double interval_s{0.5};
  double speed_mps{1.2};
  double turn_radps{0.0};
  double sigma_m{0.02};
  double claimed_over_true{1.0};  ///< sigmas
  double heading_sigma_rad{0.0};  ///< of a measured heading; 0: there is none
};

/// Noise-free pairs along a straight line or an arc.
std::vector<AlignmentPair> drive_pairs(const Drive& drive, const YawPose& T_map_odom) {
  std::vector<AlignmentPair> pairs;
  Eigen::Vector3d p_odom_m{0.3, -0.2, 0.1};
  for (int k = 0; k < drive.fixes; ++k) {
    const double heading_rad = 0.4 + drive.turn_radps * k * drive.interval_s;
    const double step_m = drive.speed_mps * drive.interval_s;
    AlignmentPair pair;
    pair.stamp_ns = from_seconds(100.0 + k * drive.interval_s);
    pair.p_odom_m = p_odom_m;
    pair.p_map_m = T_map_odom.pose() * p_odom_m;
    pair.variance_map_m2.setConstant(drive.sigma_m * drive.sigma_m);
    pair.distance_m = step_m * k;
    pairs.push_back(pair);
    p_odom_m += step_m * Eigen::Vector3d(std::cos(heading_rad), std::sin(heading_rad), 0.01);
  }
  return pairs;
}

/// Turns odom about the newest pair.
void tilt_odom(std::vector<AlignmentPair>& pairs, const Eigen::Vector3d& tilt_rad) {
  const Eigen::Vector3d newest_m = pairs.back().p_odom_m;
  for (AlignmentPair& pair : pairs) {
    pair.p_odom_m = newest_m + so3_exp(tilt_rad) * (pair.p_odom_m - newest_m);
  }
}

/// Adds what the configuration says GPS errors are: a Gauss-Markov and a white part; and LIO's
/// walk and tilt.
void add_errors(std::vector<AlignmentPair>& pairs, const AlignmentConfig& config, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  const auto sample = [&] {
    return Eigen::Vector3d(normal(generator), normal(generator), normal(generator));
  };
  Eigen::Vector3d slow = sample();
  Eigen::Vector3d walk_m = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (k > 0) {
      const double rho = std::exp(-to_seconds(pairs[k].stamp_ns - pairs[k - 1].stamp_ns) /
                                  config.correlation_time_s);
      slow = rho * slow + std::sqrt(1.0 - rho * rho) * sample();
      walk_m += config.lio_drift_m_per_sqrt_m *
                std::sqrt(pairs[k].distance_m - pairs[k - 1].distance_m) * sample();
    }
    const Eigen::Vector3d sigma_m = pairs[k].variance_map_m2.cwiseSqrt();
    pairs[k].p_map_m += sigma_m.cwiseProduct(std::sqrt(config.correlated_share) * slow +
                                             std::sqrt(config.white_share) * sample());
    pairs[k].p_odom_m += walk_m;
  }
  const Eigen::Vector3d tilt_rad = config.lio_tilt_sigma_rad * sample();
  tilt_odom(pairs, {tilt_rad.x(), tilt_rad.y(), 0.0});
}

TEST(YawAlignment, recovers_a_170_degree_yaw_from_noise_free_pairs) {
  Drive drive;
  drive.turn_radps = 0.1;
  const auto solution = solve_alignment(drive_pairs(drive, kTrueAlignment), {});
  ASSERT_TRUE(solution);
  EXPECT_NEAR(solution->T_map_odom.yaw_rad, kTrueAlignment.yaw_rad, 1e-9);
  EXPECT_NEAR((solution->T_map_odom.p - kTrueAlignment.p).norm(), 0.0, 1e-8);
  EXPECT_EQ(find_obstacle(*solution, {}), std::nullopt);
}

TEST(YawAlignment, needs_only_a_straight_line_at_any_yaw) {
  for (int degrees = -180; degrees < 180; degrees += 15) {
    const YawPose truth{degrees * kDegree_rad, kTrueAlignment.p};
    const auto solution = solve_alignment(drive_pairs({}, truth), {});
    ASSERT_TRUE(solution);
    EXPECT_NEAR(wrap_angle(solution->T_map_odom.yaw_rad - truth.yaw_rad), 0.0, 1e-9) << degrees;
    EXPECT_EQ(find_obstacle(*solution, {}), std::nullopt) << degrees;
  }
}

TEST(YawAlignment, is_not_admitted_after_three_metres) {
  Drive drive;
  drive.fixes = 30;
  drive.speed_mps = 0.2;
  const auto solution = solve_alignment(drive_pairs(drive, kTrueAlignment), {});
  ASSERT_TRUE(solution);
  EXPECT_LT(solution->baseline_m, 3.0);
  EXPECT_THAT(find_obstacle(*solution, {}).value_or(""), testing::HasSubstr("baseline"));
}

TEST(YawAlignment, says_that_one_pair_does_not_give_a_yaw) {
  Drive drive;
  drive.fixes = 1;
  const auto solution = solve_alignment(drive_pairs(drive, kTrueAlignment), {});
  ASSERT_TRUE(solution);
  EXPECT_GT(solution->yaw_sigma_rad(), 3.0);
}

TEST(YawAlignment, waits_for_a_longer_baseline_when_fixes_are_coarse) {
  Drive drive;
  drive.fixes = 40;
  drive.sigma_m = 1.5;
  const auto solution = solve_alignment(drive_pairs(drive, kTrueAlignment), {});
  ASSERT_TRUE(solution);
  EXPECT_THAT(find_obstacle(*solution, {}).value_or(""), testing::HasSubstr("yaw sigma"));
}

/// 200 drives: the spread of the errors against the sigma that was predicted.
struct Spread {
  double yaw_rms_rad{0.0};
  double yaw_sigma_rad{0.0};
  double nees{0.0};  // of all four states; 4 when the covariance is right
};

Spread measure_spread(const Drive& drive) {
  constexpr unsigned kSeeds = 200;
  const AlignmentConfig config;
  Spread spread;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    std::vector<AlignmentPair> pairs = drive_pairs(drive, kTrueAlignment);
    add_errors(pairs, config, seed);
    for (AlignmentPair& pair : pairs) {
      pair.variance_map_m2 *= drive.claimed_over_true * drive.claimed_over_true;
      pair.least_share = 1.0 / (drive.claimed_over_true * drive.claimed_over_true);
    }
    std::mt19937 generator(1000 + seed);
    std::normal_distribution<double> heading_error_rad(0.0, drive.heading_sigma_rad);
    std::optional<YawPrior> heading;
    if (drive.heading_sigma_rad > 0.0) {
      heading = {wrap_angle(kTrueAlignment.yaw_rad + heading_error_rad(generator)),
                 drive.heading_sigma_rad};
    }
    const AlignmentSolution solution = solve_alignment(pairs, config, 0.0, heading).value();
    // LIO's walk is counted back from the newest pair: the truth is the transform that maps the
    // newest pair's drifted position to where it is.
    const Eigen::Vector3d drift_m =
        pairs.back().p_odom_m - drive_pairs(drive, kTrueAlignment).back().p_odom_m;
    Eigen::Vector4d error;
    error[0] = wrap_angle(solution.T_map_odom.yaw_rad - kTrueAlignment.yaw_rad);
    error.tail<3>() =
        solution.T_map_odom.p - (kTrueAlignment.p - from_yaw(kTrueAlignment.yaw_rad) * drift_m);
    spread.yaw_rms_rad += error[0] * error[0] / kSeeds;
    spread.yaw_sigma_rad += solution.covariance(0, 0) / kSeeds;
    spread.nees += error.dot(solution.covariance.ldlt().solve(error)) / kSeeds;
  }
  spread.yaw_rms_rad = std::sqrt(spread.yaw_rms_rad);
  spread.yaw_sigma_rad = std::sqrt(spread.yaw_sigma_rad);
  testing::Test::RecordProperty("yaw_rms_over_sigma",
                                std::to_string(spread.yaw_rms_rad / spread.yaw_sigma_rad));
  testing::Test::RecordProperty("nees", std::to_string(spread.nees));
  return spread;
}

// 200 draws know a sigma to 5 %; robust weights and the scaling by chi-square make the prediction
// slightly cautious.
constexpr double kLowestRatio = 0.75;
constexpr double kHighestRatio = 1.15;

TEST(YawAlignment, predicts_the_yaw_error_of_rtk_with_correlated_errors) {
  const Spread spread = measure_spread({});
  EXPECT_GT(spread.yaw_rms_rad / spread.yaw_sigma_rad, kLowestRatio);
  EXPECT_LT(spread.yaw_rms_rad / spread.yaw_sigma_rad, kHighestRatio);
  EXPECT_GT(spread.nees, 4.0 * 0.5);
  EXPECT_LT(spread.nees, 4.0 * 1.25);
}

TEST(YawAlignment, predicts_the_yaw_error_of_coarse_gps_with_correlated_errors) {
  Drive drive;
  drive.sigma_m = 1.0;
  drive.fixes = 100;
  drive.turn_radps = 0.02;
  const Spread spread = measure_spread(drive);
  EXPECT_GT(spread.yaw_rms_rad / spread.yaw_sigma_rad, kLowestRatio);
  EXPECT_LT(spread.yaw_rms_rad / spread.yaw_sigma_rad, kHighestRatio);
}

TEST(YawAlignment, predicts_the_yaw_error_with_a_heading_as_good_as_the_way) {
  Drive drive;
  drive.sigma_m = 1.0;
  drive.fixes = 60;
  const Spread alone = measure_spread(drive);
  drive.heading_sigma_rad = alone.yaw_sigma_rad;
  const Spread spread = measure_spread(drive);
  EXPECT_GT(spread.yaw_rms_rad / spread.yaw_sigma_rad, kLowestRatio);
  EXPECT_LT(spread.yaw_rms_rad / spread.yaw_sigma_rad, kHighestRatio);
  EXPECT_NEAR(spread.yaw_sigma_rad / alone.yaw_sigma_rad, std::sqrt(0.5), 0.07);
  EXPECT_GT(spread.nees, 4.0 * 0.5);
  EXPECT_LT(spread.nees, 4.0 * 1.25);
}

TEST(YawAlignment, believes_fixes_that_scatter_less_than_a_cautious_filter_says) {
  const Spread as_said = measure_spread({});
  Drive cautious;
  cautious.claimed_over_true = 2.0;
  const Spread spread = measure_spread(cautious);
  EXPECT_LT(spread.yaw_sigma_rad, 1.4 * as_said.yaw_sigma_rad);  // 2 without it
  EXPECT_GT(spread.yaw_rms_rad / spread.yaw_sigma_rad, 0.65);
  EXPECT_LT(spread.nees, 4.0 * 1.25);
}

TEST(YawAlignment, would_be_overconfident_without_the_correlation) {
  Drive drive;
  drive.sigma_m = 1.0;
  drive.fixes = 100;
  std::vector<AlignmentPair> pairs = drive_pairs(drive, kTrueAlignment);
  AlignmentConfig white;
  white.correlated_share = 0.0;
  white.white_share = 1.2;
  const double honest_rad = solve_alignment(pairs, {}).value().yaw_sigma_rad();
  const double white_rad = solve_alignment(pairs, white).value().yaw_sigma_rad();
  EXPECT_GT(honest_rad, 2.0 * white_rad);
}

TEST(YawAlignment, is_not_spoiled_by_wild_fixes) {
  Drive drive;
  drive.fixes = 30;
  std::vector<AlignmentPair> pairs = drive_pairs(drive, kTrueAlignment);
  add_errors(pairs, {}, 7);
  const AlignmentSolution clean = solve_alignment(pairs, {}).value();
  pairs[2].p_map_m += Eigen::Vector3d(40.0, -60.0, 20.0);
  pairs[17].p_map_m += Eigen::Vector3d(-5.0, 3.0, 0.0);
  pairs.back().p_map_m += Eigen::Vector3d(0.0, 8.0, -4.0);
  const AlignmentSolution spoiled = solve_alignment(pairs, {}).value();
  EXPECT_NEAR(spoiled.T_map_odom.yaw_rad, clean.T_map_odom.yaw_rad, clean.yaw_sigma_rad());
  EXPECT_LT((spoiled.T_map_odom.p - clean.T_map_odom.p).norm(), 0.05);
  EXPECT_EQ(find_obstacle(spoiled, {}), std::nullopt);
}

TEST(YawAlignment, refuses_residuals_far_beyond_the_reported_sigmas) {
  std::vector<AlignmentPair> pairs = drive_pairs({}, kTrueAlignment);
  for (std::size_t k = 0; k < pairs.size(); ++k) {  // 20 sigma, alternating
    pairs[k].p_map_m.y() += k % 2 == 0 ? 0.4 : -0.4;
  }
  const AlignmentSolution solution = solve_alignment(pairs, {}).value();
  EXPECT_NE(find_obstacle(solution, {}), std::nullopt);
}

TEST(YawAlignment, gives_the_covariance_of_a_hand_made_case) {
  // White errors only, no drift, pairs symmetric about the odom origin: yaw and translation
  // separate, sigma_yaw^2 = s^2 / sum |a|^2 and sigma_t^2 = s^2 / n.
  AlignmentConfig config;
  config.correlated_share = 0.0;
  config.white_share = 1.0;
  config.lio_drift_m_per_sqrt_m = 0.0;
  std::vector<AlignmentPair> pairs;
  double sum_m2 = 0.0;
  for (int k = -5; k <= 5; ++k) {
    AlignmentPair pair;
    pair.stamp_ns = from_seconds(k);
    pair.p_odom_m = {2.0 * k, -1.0 * k, 0.0};
    pair.p_map_m = kTrueAlignment.pose() * pair.p_odom_m;
    pair.variance_map_m2.setConstant(0.04);
    sum_m2 += pair.p_odom_m.squaredNorm();
    pairs.push_back(pair);
  }
  const AlignmentSolution solution = solve_alignment(pairs, config).value();
  EXPECT_NEAR(solution.covariance(0, 0), 0.04 / sum_m2, 1e-7);
  EXPECT_NEAR(solution.covariance(1, 1), 0.04 / 11.0, 1e-7);
  EXPECT_NEAR(solution.covariance(0, 1), 0.0, 1e-9);
}

TEST(YawAlignment, a_tilted_odom_costs_little_height_where_the_robot_is) {
  const auto height_error_m = [](double modelled_sigma_rad) {
    AlignmentConfig config;
    config.lio_tilt_sigma_rad = modelled_sigma_rad;
    Drive coarse;  // with fine fixes the walk of LIO forgets old pairs, and hides the tilt
    coarse.sigma_m = 0.5;
    std::vector<AlignmentPair> pairs = drive_pairs(coarse, kTrueAlignment);
    tilt_odom(pairs, {0.02, -0.01, 0.0});
    const AlignmentSolution solution = solve_alignment(pairs, config).value();
    return std::abs(
        (solution.T_map_odom.pose() * pairs.back().p_odom_m - pairs.back().p_map_m).z());
  };
  const double unmodelled_m = height_error_m(0.0);
  EXPECT_GT(unmodelled_m, 0.1);
  EXPECT_LT(height_error_m(0.02), 0.5 * unmodelled_m);
}

/// Pairs of 300 m whose source is a grid with this scale.
std::vector<AlignmentPair> grid_pairs(double scale) {
  const Drive drive{100, 1.0, 3.0, 0.02};
  std::vector<AlignmentPair> pairs = drive_pairs(drive, kTrueAlignment);
  for (AlignmentPair& pair : pairs) {
    pair.p_odom_m.head<2>() *= scale;
  }
  return pairs;
}

TEST(YawAlignment, finds_the_scale_of_a_grid_when_asked) {
  AlignmentConfig config;
  config.lio_drift_m_per_sqrt_m = 0.0;
  config.lio_tilt_sigma_rad = 0.0;
  const auto solution = solve_alignment(grid_pairs(0.9996), config, 1.0);  // hardly any prior
  ASSERT_TRUE(solution);
  EXPECT_NEAR(solution->scale, 1.0 / 0.9996, 1e-7);
  EXPECT_NEAR(solution->T_map_odom.yaw_rad, kTrueAlignment.yaw_rad, 1e-8);
  EXPECT_LT((solution->T_map_odom.p - kTrueAlignment.p).norm(), 1e-6);
}

TEST(YawAlignment, leaves_the_scale_at_one_when_not_asked) {
  const auto solution = solve_alignment(grid_pairs(0.9996), {});
  ASSERT_TRUE(solution);
  EXPECT_DOUBLE_EQ(solution->scale, 1.0);
  EXPECT_EQ(solution->scale_covariance[4], 0.0);
}

TEST(YawAlignment, predicts_the_error_of_the_scale_with_correlated_errors) {
  AlignmentConfig config;
  config.lio_drift_m_per_sqrt_m = 0.0;
  config.lio_tilt_sigma_rad = 0.0;
  constexpr unsigned kRuns = 60;
  double normalised = 0.0;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    std::vector<AlignmentPair> pairs = grid_pairs(0.9996);
    add_errors(pairs, config, seed);
    const auto solution = solve_alignment(pairs, config, 1.0);
    const double error = solution->scale - 1.0 / 0.9996;
    normalised += error * error / solution->scale_covariance[4] / kRuns;
  }
  EXPECT_GT(normalised, 0.5);  // chi-square of 60 degrees of freedom: 0.54 to 1.66 at 99.9 %
  EXPECT_LT(normalised, 1.66);
}

TEST(YawAlignment, returns_nothing_without_pairs_or_with_nan) {
  EXPECT_FALSE(solve_alignment({}, {}));
  std::vector<AlignmentPair> pairs = drive_pairs({}, kTrueAlignment);
  pairs[3].p_map_m.x() = std::nan("");
  EXPECT_FALSE(solve_alignment(pairs, {}));
}

/// Once an alignment from 5 m of fixes on a grid of 1e-5 degrees was 9 degrees off at a stated 0.7:
/// a filter had smoothed them.
TEST(YawAlignment, is_no_better_than_what_the_receiver_says_lies_about_the_way) {
  const AlignmentConfig config;
  const auto yaw_sigma_rad = [&](const auto& received) {
    std::vector<AlignmentPair> pairs = drive_pairs({.fixes = 12}, kTrueAlignment);
    for (AlignmentPair& pair : pairs) {
      const Eigen::Vector2d smooth_m = pair.p_map_m.head<2>();
      pair.received_off_m = received(smooth_m) - smooth_m;
    }
    return solve_alignment(pairs, config)->yaw_sigma_rad();
  };
  const auto same = [](const Eigen::Vector2d& p) -> Eigen::Vector2d { return p; };
  const auto near = [](const Eigen::Vector2d& p) -> Eigen::Vector2d { return p.array() + 0.01; };
  const auto on_grid = [](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return p.array().round();
  };
  EXPECT_EQ(yaw_sigma_rad(near), yaw_sigma_rad(same));
  EXPECT_LT(yaw_sigma_rad(same), 0.5 * config.max_yaw_sigma_rad);
  EXPECT_GT(yaw_sigma_rad(on_grid), 3.0 * config.max_yaw_sigma_rad);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
