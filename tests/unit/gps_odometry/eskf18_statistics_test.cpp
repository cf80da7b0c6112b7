// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The statistics of eskf18 over few runs, for every day; eskf18_long_test has the full numbers.
#include "eskf18_drives.hpp"
#include <gtest/gtest.h>

#include <algorithm>

namespace trigpoint::gps_odometry {
namespace {

constexpr int kStatisticsRuns = 8;

TEST(Eskf18Statistics, outages_stay_small_and_within_sigma) {
  for (const double speed : {1.5, 5.0}) {
    double inside = 0.0;
    const auto figures = measure_outage(speed, kStatisticsRuns, config_with_datum("eskf18"));
    for (const OutageFigure& figure : figures) {
      inside += figure.inside / static_cast<double>(figures.size());
    }
    EXPECT_LT(figures.back().rms_m, 8.0);
    EXPECT_GE(inside, 0.9);
  }
}

TEST(Eskf18Statistics, raw_covariance_is_neither_half_nor_double_the_error) {
  // 24 degrees of freedom an epoch: mean 1, 99.9 % of single epochs within [0.3, 2.3].
  const auto anees = measure_raw_anees(kStatisticsRuns);
  EXPECT_GT(*std::min_element(anees.begin(), anees.end()), 0.3);
  EXPECT_LT(*std::max_element(anees.begin(), anees.end()), 2.3);
}

TEST(Eskf18Statistics, town_errors_are_within_the_published_sigma) {
  const UrbanFigure figure = measure_urban(kStatisticsRuns, 240.0);
  EXPECT_LE(figure.anees, 2.0);
  EXPECT_GE(figure.inside, 0.95);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
