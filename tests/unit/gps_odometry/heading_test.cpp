// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "heading.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kOffset_rad = 2.1;  // of the level frame in map

/// Driving with `yaw(t)` in the level frame at `speed`, fixes at 5 Hz with noise.
std::optional<HeadingEstimate> search(double speed_mps,
                                      double yaw_rate_radps,
                                      double sigma_m,
                                      double duration_s,
                                      unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, sigma_m);
  HeadingSearch heading;
  Eigen::Vector2d position(5.0, -3.0);
  constexpr double kStep_s = 0.2;
  for (double t = 0.0; t < duration_s; t += kStep_s) {
    CoursePoint point;
    point.stamp_ns = from_seconds(t);
    point.antenna_map_m = position + Eigen::Vector2d(normal(random), normal(random));
    point.sigma_m = sigma_m;
    point.yaw_relative_rad = wrap_angle(yaw_rate_radps * t);
    if (const auto estimate = heading.add(point, Config{})) {
      return estimate;
    }
    const double middle = kOffset_rad + yaw_rate_radps * (t + 0.5 * kStep_s);
    position += speed_mps * kStep_s * Eigen::Vector2d(std::cos(middle), std::sin(middle));
  }
  return std::nullopt;
}

TEST(HeadingSearch, finds_the_heading_on_a_straight_within_its_sigma) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto estimate = search(1.5, 0.0, 0.028, 20.0, seed);
    ASSERT_TRUE(estimate.has_value());
    EXPECT_LT(std::abs(wrap_angle(estimate->yaw_map_relative_rad - kOffset_rad)),
              3.0 * estimate->sigma_rad);
    EXPECT_LE(estimate->sigma_rad, Config{}.heading_sigma_rad);
  }
}

TEST(HeadingSearch, finds_the_heading_in_a_curve) {
  const auto estimate = search(2.0, 0.5, 0.028, 20.0, 1);
  ASSERT_TRUE(estimate.has_value());
  EXPECT_NEAR(wrap_angle(estimate->yaw_map_relative_rad - kOffset_rad), 0.0, 0.06);
}

TEST(HeadingSearch, finds_nothing_at_rest_in_the_noise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    EXPECT_FALSE(search(0.0, 0.0, 0.028, 300.0, seed)) << "seed " << seed;
    EXPECT_FALSE(search(0.0, 0.0, 3.0, 300.0, seed)) << "seed " << seed;
  }
}

TEST(HeadingSearch, needs_a_longer_way_with_worse_fixes) {
  EXPECT_TRUE(search(1.5, 0.0, 0.028, 4.0, 1));
  EXPECT_FALSE(search(1.5, 0.0, 3.0, 4.0, 1));
}

}  // namespace
}  // namespace trigpoint::gps_odometry
