// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "extrinsic_rotation.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace trigpoint::lio_mapper {

namespace {

constexpr double kTurnPrior_rad = 0.03;
constexpr double kScanPeriod_s = 0.1;
constexpr double kScanNoise_rad = 3e-4;
/// Of the noise of one scan, what the next one shares: they are matched with the same map.
constexpr double kSharedNoise = 0.9;

using Motion = std::function<Eigen::Quaterniond(double)>;

/// Drives round corners, over ground that rolls and pitches it by a degree.
Eigen::Quaterniond on_the_ground(double t) {
  return from_yaw(1.2 * std::sin(0.3 * t)) *
         so3_exp({0.015 * std::sin(1.7 * t), 0.012 * std::cos(1.3 * t), 0.0});
}

Eigen::Quaterniond on_a_line(double /*t*/) {
  return from_yaw(0.4);
}

/// A LiDAR turned by `lacking_rad` from the configuration, corrected as windows end; gyro with a
/// bias and without noise.
ExtrinsicRotationEstimator after(double duration_s,
                                 const Motion& true_attitude,
                                 const Eigen::Vector3d& lacking_rad,
                                 unsigned seed,
                                 double clock_offset_s = 0.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  ExtrinsicRotationEstimator estimator(kTurnPrior_rad);
  AttitudeWindow window;
  Eigen::Vector3d noise = Eigen::Vector3d::Zero();
  Eigen::Vector3d taken_rad = Eigen::Vector3d::Zero();
  const Eigen::Quaterniond C = so3_exp({0.1, -0.2, 0.5});
  for (int i = 0; i * kScanPeriod_s < duration_s; ++i) {
    const double t = i * kScanPeriod_s;
    if (window.samples.size() == 30) {
      estimator.add(window, taken_rad);
      taken_rad = estimator.certain_turn_base_rad();
      window.samples.clear();
    }
    const Eigen::Quaterniond q_true = true_attitude(t);
    const Eigen::Quaterniond lacking = so3_exp(lacking_rad) * so3_exp(taken_rad).conjugate();
    noise =
        kSharedNoise * noise + std::sqrt(1.0 - kSharedNoise * kSharedNoise) *
                                   Eigen::Vector3d(normal(random), normal(random), normal(random));
    AttitudeSample sample;
    sample.time_s =
        window.samples.empty() ? 0.0 : kScanPeriod_s * static_cast<double>(window.samples.size());
    sample.q_scan =
        C * true_attitude(t + clock_offset_s) * lacking * so3_exp(kScanNoise_rad * noise);
    sample.q_gyro = window.samples.empty()
                        ? sample.q_scan
                        : window.samples.front().q_gyro *
                              true_attitude(t - sample.time_s).conjugate() * q_true *
                              so3_exp(Eigen::Vector3d(1e-4, -2e-4, 1e-4) * sample.time_s);
    const double h = 1e-4;
    sample.rate_odom_radps =
        sample.q_scan *
        (so3_log(true_attitude(t - h).conjugate() * true_attitude(t + h)) / (2.0 * h));
    window.samples.push_back(sample);
  }
  return estimator;
}

TEST(ExtrinsicRotation, is_found_within_what_is_stated) {
  const Eigen::Vector3d lacking_rad{0.02, -0.02, 0.015};
  double nees = 0.0;
  constexpr int kRuns = 20;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const auto found = after(90.0, on_the_ground, lacking_rad, seed);
    const Eigen::Vector3d error = found.turn_base_rad() - lacking_rad;
    EXPECT_LT(error.head<2>().norm(), 3e-3);
    EXPECT_LT(std::sqrt(found.covariance()(0, 0)), 2e-3);
    nees += error.dot(found.covariance().ldlt().solve(error)) / (3.0 * kRuns);
  }
  EXPECT_LT(nees, 1.65);  // chi-square of 60, 0.1 %
  EXPECT_GT(nees, 0.1);
}

TEST(ExtrinsicRotation, stays_where_it_is_when_the_configuration_is_right) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto found = after(90.0, on_the_ground, Eigen::Vector3d::Zero(), seed);
    EXPECT_LT(found.turn_base_rad().norm(), 3.0 * std::sqrt(found.covariance().trace()));
    EXPECT_LT(found.turn_base_rad().head<2>().norm(), 3e-3);
  }
}

TEST(ExtrinsicRotation, is_not_known_about_the_axis_of_all_turns_and_without_a_turn) {
  const Eigen::Vector3d lacking_rad{0.02, -0.02, 0.015};
  const auto flat = [](double t) { return from_yaw(1.2 * std::sin(0.3 * t)); };
  const auto turned = after(90.0, flat, lacking_rad, 1);
  EXPECT_GT(std::sqrt(turned.covariance()(2, 2)), 0.9 * kTurnPrior_rad);
  EXPECT_LT(std::sqrt(turned.covariance()(0, 0)), 2e-3);
  const auto straight = after(90.0, on_a_line, lacking_rad, 1);
  EXPECT_GT(std::sqrt(straight.covariance()(0, 0)), 0.9 * kTurnPrior_rad);
  EXPECT_LT(straight.turn_base_rad().norm(), 0.1 * kTurnPrior_rad);
}

TEST(ExtrinsicRotation, is_certain_along_axes_that_turns_taught_and_nothing_along_others) {
  const Eigen::Vector3d lacking_rad{0.02, -0.02, 0.015};
  const auto flat = [](double t) { return from_yaw(1.2 * std::sin(0.3 * t)); };
  EXPECT_EQ(after(90.0, on_a_line, lacking_rad, 1).certain_turn_base_rad().norm(), 0.0);
  const Eigen::Vector3d certain = after(90.0, flat, lacking_rad, 1).certain_turn_base_rad();
  const Eigen::Matrix3d covariance = after(90.0, flat, lacking_rad, 1).certain_covariance();
  EXPECT_NEAR(std::sqrt(covariance(2, 2)), kTurnPrior_rad, 1e-3);
  EXPECT_LT(std::sqrt(covariance(0, 0)), 2e-3);
  EXPECT_LT((certain - Eigen::Vector3d(0.02, -0.02, 0.0)).norm(), 3e-3);
}

/// Carried by hand: all axes turn, and so does the axis of turning.
Eigen::Quaterniond by_hand(double t) {
  return from_roll_pitch_yaw(
      {0.4 * std::sin(0.9 * t), 0.3 * std::sin(0.7 * t + 1.0), 1.2 * std::sin(0.4 * t)});
}

TEST(ExtrinsicRotation, is_not_taken_for_a_clock_that_is_off) {
  constexpr double kClockOff_s = 0.05;
  const auto found = after(90.0, by_hand, Eigen::Vector3d::Zero(), 3, kClockOff_s);
  EXPECT_LT(found.turn_base_rad().norm(), 1.5e-3);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
