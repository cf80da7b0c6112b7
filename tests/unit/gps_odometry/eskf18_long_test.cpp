// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Monte-Carlo over 50 runs: the figures of README.md.
#include "eskf18_drives.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

namespace trigpoint::gps_odometry {
namespace {

constexpr int kRuns = 50;
// 95 % of the means of 50 NEES of 3 degrees of freedom, per degree of freedom.
constexpr double kLeastAnees = 0.787;
constexpr double kMostAnees = 1.239;

struct OutageCase {
  double speed_mps;
  double limit_10_m;
  double limit_30_m;
  double limit_60_m;
};

class Eskf18Outage : public testing::TestWithParam<OutageCase> {};

TEST_P(Eskf18Outage, drifts_less_than_its_limits_and_within_its_sigma) {
  const auto& [speed, limit_10_m, limit_30_m, limit_60_m] = GetParam();
  const auto figures = measure_outage(speed, kRuns, config_with_datum("eskf18"));
  for (const OutageFigure& figure : figures) {
    std::printf("outage %.1f m/s %4.0f s: rms %.3f m, sigma %.3f m, inside 1.96 sigma %.3f\n",
                speed,
                figure.age_s,
                figure.rms_m,
                figure.sigma_m,
                figure.inside);
    EXPECT_GE(figure.inside, 0.93) << "150 axes: 95 % less twice its own spread of 1.8 %";
  }
  EXPECT_LT(figures[3].rms_m, limit_10_m);
  EXPECT_LT(figures[4].rms_m, limit_30_m);
  EXPECT_LT(figures[5].rms_m, limit_60_m);
}

INSTANTIATE_TEST_SUITE_P(Speeds,
                         Eskf18Outage,
                         testing::Values(OutageCase{1.5, 1.5, 4.0, 8.0},
                                         OutageCase{5.0, 2.0, 8.0, 12.0}));

TEST(Eskf18Long, raw_covariance_is_consistent_where_model_and_truth_match) {
  int inside = 0;
  for (const double anees : measure_raw_anees(kRuns)) {
    std::printf("%.3f ", anees);
    inside += anees > kLeastAnees && anees < kMostAnees ? 1 : 0;
  }
  std::printf(
      "\nraw 3-D position ANEES inside [%.3f, %.3f]: %d of 20\n", kLeastAnees, kMostAnees, inside);
  EXPECT_GE(inside, 18);
}

TEST(Eskf18Long, published_covariance_holds_between_houses) {
  const UrbanFigure figure = measure_urban(kRuns, 480.0);
  std::printf(
      "urban: ANEES %.3f, inside 1.96 sigma %.4f, rms %.3f m, worst %.2f m, median sigma "
      "%.3f m\n",
      figure.anees,
      figure.inside,
      figure.rms_m,
      figure.worst_m,
      figure.median_sigma_m);
  EXPECT_LE(figure.anees, 2.0);
  EXPECT_GE(figure.inside, 0.95);
  EXPECT_LE(figure.median_sigma_m, 4.0 * figure.rms_m);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
