// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/displacement.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::fusion_gate {
namespace {

LioStatus placed(double yaw_rad, double yaw_sigma_rad) {
  LioStatus lio;
  lio.aligned = true;
  lio.T_map_odom = {yaw_rad, {100.0, -50.0, 3.0}};
  lio.T_map_odom_covariance = Matrix6d::Zero();
  lio.T_map_odom_covariance(0, 0) = yaw_sigma_rad * yaw_sigma_rad;
  lio.T_map_odom_covariance.diagonal().segment<3>(1).setConstant(1e4);  // has no part in it
  return lio;
}

Difference of(const Eigen::Vector3d& d_m, const Eigen::Vector3d& variance_m2) {
  return {d_m, variance_m2.asDiagonal()};
}

TEST(Displacement, counts_sigmas_by_the_probability_of_a_normal_variable) {
  // Chi-square with 2 degrees of freedom exceeds 13.816 with probability 0.001, as a normal
  // variable exceeds 3.2905 sigmas; 5.991 and 1.96 go with 0.05.
  const Eigen::Vector3d one = Eigen::Vector3d::Ones();
  EXPECT_NEAR(sigmas_of(of({std::sqrt(13.8155), 0.0, 0.0}, one), Part::kLevel), 3.2905, 1e-3);
  EXPECT_NEAR(sigmas_of(of({0.0, std::sqrt(5.9915), 0.0}, one), Part::kLevel), 1.95996, 1e-3);
  EXPECT_NEAR(sigmas_of(of({9.0, 9.0, -2.0}, {1.0, 1.0, 4.0}), Part::kHeight), 1.0, 1e-9);
  EXPECT_GT(sigmas_of(of({30.0, 0.0, 0.0}, one), Part::kLevel), 7.0);
}

TEST(Displacement, permits_the_length_that_reaches_the_limit) {
  const Difference difference = of({0.3, 0.4, 0.0}, {0.01, 0.01, 0.01});
  const double permitted = permitted_m(difference, Part::kLevel, 3.0);
  const Difference at_limit = of(Eigen::Vector3d(0.6, 0.8, 0.0) * permitted, {0.01, 0.01, 0.01});
  EXPECT_NEAR(sigmas_of(at_limit, Part::kLevel), 3.0, 0.25);  // linear in the sigmas, nearly
}

TEST(Displacement, does_not_see_the_translation_of_T_map_odom) {
  const LioStatus lio = placed(1.0, 0.0);
  Sighting from;
  from.lio_odom_m = {1.0, 2.0, 0.0};
  from.gps_map_m = {500.0, 600.0, 70.0};
  Sighting to = from;
  to.lio_odom_m += Eigen::Vector3d(10.0, 0.0, 1.0);
  to.gps_map_m += from_yaw(1.0) * Eigen::Vector3d(10.0, 0.0, 1.0);
  to.distance_m = 10.0;
  EXPECT_NEAR(compare_displacement(from, to, lio, Config{}).d_map_m.norm(), 0.0, 1e-9);
}

TEST(Displacement, predicts_the_scatter_of_what_it_accounts_for) {
  Config config;
  const double yaw_sigma_rad = 0.01;
  const LioStatus lio = placed(0.7, yaw_sigma_rad);
  Sighting from;
  from.gps_variance_m2 = {0.01, 0.02, 0.03};
  Sighting to = from;
  to.distance_m = 30.0;
  to.lio_odom_m = {30.0, 0.0, 0.0};
  const Difference predicted = compare_displacement(from, to, lio, config);
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  const double yaw_walk = config.smooth.lio_yaw_drift_rad_per_sqrt_m * std::sqrt(30.0 / 3.0);
  const double walk_m = config.smooth.lio_drift_m_per_sqrt_m * std::sqrt(30.0);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  constexpr int kRuns = 20000;
  for (int run = 0; run < kRuns; ++run) {
    const double yaw_rad = 0.7 + yaw_sigma_rad * normal(random) + yaw_walk * normal(random);
    Eigen::Vector3d walked(normal(random), normal(random), normal(random));
    Sighting seen = to;
    seen.gps_map_m = from_yaw(yaw_rad) * (to.lio_odom_m + walk_m * walked);
    for (int i = 0; i < 3; ++i) {
      seen.gps_map_m[i] += std::sqrt(2.0 * from.gps_variance_m2[i]) * normal(random);
    }
    const Eigen::Vector3d d = compare_displacement(from, seen, lio, config).d_map_m;
    sum += d * d.transpose();
  }
  EXPECT_LT((sum / kRuns - predicted.covariance_m2).norm(), 0.03 * predicted.covariance_m2.norm());
}

TEST(Displacement, knows_nothing_along_an_axis_of_odom_that_was_driven_blind) {
  const LioStatus lio = placed(0.0, 0.0);
  Sighting from;
  Sighting to;
  to.distance_m = 40.0;
  to.lio_odom_m = {40.0, 0.0, 0.0};
  to.blind_m = {40.0, 0.0, 0.0};
  const Difference difference = compare_displacement(from, to, lio, Config{});
  EXPECT_GT(std::sqrt(difference.covariance_m2(0, 0)), 40.0);
  EXPECT_LT(std::sqrt(difference.covariance_m2(1, 1)), 2.0);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
