// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/algorithm_one.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace trigpoint::fusion_gate {
namespace {

const Eigen::Vector3d kAcceptance_m{0.5, 0.5, 1.0};

Eigen::Vector3d variances(double sigma_x_m, double sigma_y_m, double sigma_z_m) {
  return Eigen::Vector3d(sigma_x_m, sigma_y_m, sigma_z_m).cwiseAbs2();
}

TEST(AlgorithmOne, decides_every_axis_for_itself) {
  for (int combination = 0; combination < 8; ++combination) {
    Eigen::Vector3d sigma_m;
    for (int axis = 0; axis < 3; ++axis) {
      sigma_m[axis] = kAcceptance_m[axis] * ((combination >> axis) & 1 ? 1.01 : 0.99);
    }
    const AxisChoices choices = choose_axes(Mode::kHard, sigma_m.cwiseAbs2(), kAcceptance_m);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool above = ((combination >> axis) & 1) != 0;
      EXPECT_EQ(choices[axis].decision, above ? AxisDecision::kLio : AxisDecision::kFused)
          << combination;
    }
  }
}

TEST(AlgorithmOne, fuses_at_equality_as_printed) {
  EXPECT_EQ(algorithm_one(0.25, 0.5).decision, AxisDecision::kFused);
  EXPECT_EQ(algorithm_one(std::nextafter(0.25, 1.0) + 1e-12, 0.5).decision, AxisDecision::kLio);
}

TEST(AlgorithmOne, leaves_an_axis_of_unknown_sigma_to_lio) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double variance_m2 : {std::nan(""), -1.0, infinity}) {
    const AxisChoice choice = algorithm_one(variance_m2, 0.5);
    EXPECT_EQ(choice.decision, AxisDecision::kLio) << variance_m2;
    EXPECT_EQ(choice.reason, "sigma of the GPS odometry is not known");
  }
}

TEST(AlgorithmOne, says_why_with_both_numbers) {
  EXPECT_EQ(algorithm_one(0.62 * 0.62, 0.5).reason, "sigma 0.62 m > threshold 0.50 m");
  EXPECT_EQ(algorithm_one(0.02 * 0.02, 0.5).reason, "sigma 0.02 m <= threshold 0.50 m");
}

TEST(AlgorithmOne, mode_fusion_takes_every_axis_and_mode_lio_none) {
  const Eigen::Vector3d mixed = variances(0.01, 9.0, std::nan(""));
  for (const AxisChoice& choice : choose_axes(Mode::kFusion, mixed, kAcceptance_m)) {
    EXPECT_EQ(choice.decision, AxisDecision::kFused);
  }
  EXPECT_FALSE(any_fused(choose_axes(Mode::kLio, variances(0.01, 0.01, 0.01), kAcceptance_m)));
}

TEST(AlgorithmOne, mode_literal_uses_the_same_rule_as_mode_hard) {
  const Eigen::Vector3d mixed = variances(0.4, 0.6, 0.9);
  const AxisChoices literal = choose_axes(Mode::kLiteral, mixed, kAcceptance_m);
  const AxisChoices hard = choose_axes(Mode::kHard, mixed, kAcceptance_m);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(literal[axis].decision, hard[axis].decision);
  }
  EXPECT_EQ(hard[1].decision, AxisDecision::kLio);
}

TEST(AlgorithmOne, reads_thresholds_as_variances_when_told_so) {
  Config config;
  config.threshold = {0.25, 0.25, 4.0};
  config.threshold_on = "variance";
  EXPECT_TRUE(threshold_sigma_m(config).isApprox(Eigen::Vector3d(0.5, 0.5, 2.0)));
  config.threshold_on = "sigma";
  EXPECT_TRUE(threshold_sigma_m(config).isApprox(Eigen::Vector3d(0.25, 0.25, 4.0)));
}

}  // namespace
}  // namespace trigpoint::fusion_gate
