// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_scatter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>
#include <vector>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kSaid_m2 = 0.02 * 0.02;  // of one fix along one axis

using Errors = std::array<double, 2>;

double ratio_of(const Errors& a, const Errors& b, int axes) {
  double apart_m2 = 0.0;
  for (std::size_t axis = 0; axis < static_cast<std::size_t>(axes); ++axis) {
    apart_m2 += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  }
  return FixScatter::ratio(apart_m2, 0.0, 2.0 * axes * kSaid_m2);
}

constexpr unsigned kSeeds = 400;

/// The factors of 24 fixes each that scatter by `sigma_m`, some of them some 20 m off.
std::vector<double> factors(double sigma_m, double outlier_share, int axes) {
  std::vector<double> result;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    FixScatter scatter;
    std::array<Errors, 3> newest{};
    for (int fix = 0; fix < 26; ++fix) {
      const double wide_m = uniform(random) < outlier_share ? 20.0 : sigma_m;
      newest = {newest[1], newest[2], Errors{wide_m * normal(random), wide_m * normal(random)}};
      if (fix >= 2) {
        scatter.add(ratio_of(newest[2], newest[1], axes), ratio_of(newest[2], newest[0], axes));
      }
    }
    result.push_back(scatter.factor(axes));
  }
  return result;
}

double mean_factor(double sigma_m, double outlier_share, int axes) {
  const std::vector<double> all = factors(sigma_m, outlier_share, axes);
  return std::accumulate(all.begin(), all.end(), 0.0) / kSeeds;
}

TEST(FixScatter, never_makes_fixes_better_than_they_say) {
  EXPECT_EQ(mean_factor(0.005, 0.0, 2), 1.0);
  EXPECT_EQ(mean_factor(0.005, 0.0, 1), 1.0);
}

TEST(FixScatter, leaves_fixes_that_scatter_as_they_say_alone) {
  for (const int axes : {1, 2}) {
    const std::vector<double> all = factors(0.02, 0.0, axes);
    EXPECT_LE(std::count_if(all.begin(), all.end(), [](double factor) { return factor > 1.0; }),
              kSeeds / 100);
  }
}

TEST(FixScatter, measures_a_variance_of_a_hundred_times_what_is_said) {
  EXPECT_NEAR(mean_factor(0.2, 0.0, 2), 100.0, 20.0);
  EXPECT_NEAR(mean_factor(0.2, 0.0, 1), 100.0, 50.0);
}

TEST(FixScatter, does_not_take_outliers_for_scatter) {
  const std::vector<double> all = factors(0.01, 0.3, 2);
  constexpr double kTwiceTheSigma = 4.0;
  const auto taken =
      std::count_if(all.begin(), all.end(), [](double factor) { return factor > kTwiceTheSigma; });
  EXPECT_LE(taken, kSeeds / 100);
}

TEST(FixScatter, does_not_take_a_second_receiver_for_scatter) {
  FixScatter scatter;
  for (int fix = 0; fix < 24; ++fix) {
    scatter.add(FixScatter::ratio(9.0, 0.0, kSaid_m2), 0.1);
  }
  EXPECT_EQ(scatter.factor(2), 1.0);
}

TEST(FixScatter, says_nothing_after_a_few_fixes_and_of_what_the_way_does_not_tell) {
  FixScatter scatter;
  for (int fix = 0; fix < 7; ++fix) {
    scatter.add(100.0, 100.0);
  }
  EXPECT_EQ(scatter.factor(2), 1.0);
  EXPECT_EQ(FixScatter::ratio(1.0, 1.0, kSaid_m2), 0.0);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
