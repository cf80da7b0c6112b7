// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults.hpp"
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

namespace trigpoint::simulator {

namespace {

const std::string kUrban = "type: gps_urban";

/// A stretch of one class, as seen from outside.
struct Seen {
  std::string gnss_class;
  double length_s;
  Eigen::Vector3d error_m;
  bool constant;  ///< the error was the same all the time
};

std::vector<Seen> intervals_of(std::uint64_t seed, double duration_s, double step_s) {
  const Scenario scenario = scenario_with_fault(kUrban);
  std::vector<Seen> seen;
  for (double t_s = 0.0; t_s < duration_s; t_s += step_s) {
    const GnssEpoch epoch = fix_at(scenario, t_s, seed);
    if (seen.empty() || seen.back().gnss_class != epoch.gnss_class) {
      seen.push_back({epoch.gnss_class, 0.0, epoch.extra_error_m, true});
    }
    seen.back().length_s += step_s;
    seen.back().constant = seen.back().constant && seen.back().error_m == epoch.extra_error_m;
  }
  seen.pop_back();  // cut off
  return seen;
}

}  // namespace

TEST(GpsUrban, spends_the_shares_of_time_of_the_dwell_table) {
  const Scenario scenario = scenario_with_fault(kUrban);
  constexpr int kSeeds = 20000;
  constexpr double kSettled_s = 1500.0;  // the start, always fixed, is forgotten
  std::map<std::string, int> count;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    ++count[fix_at(scenario, kSettled_s, seed).gnss_class];
  }
  const std::map<std::string, double> expected{
      {"fixed", 0.55}, {"float", 0.25}, {"code", 0.12}, {"none", 0.08}};
  for (const auto& [gnss_class, share] : expected) {
    EXPECT_NEAR(
        static_cast<double>(count[gnss_class]) / kSeeds, share, share_tolerance(share, kSeeds))
        << gnss_class;
  }
}

TEST(GpsUrban, keeps_every_dwell_within_its_limits_and_begins_with_a_right_fixed_one) {
  constexpr double kStep_s = 0.1;
  const std::map<std::string, Bounds> limits{{"fixed", {20.0, 60.0}},
                                             {"float", {10.0, 25.0}},
                                             {"code", {5.0, 15.0}},
                                             {"none", {4.0, 16.0}}};
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const std::vector<Seen> intervals = intervals_of(seed, 1500.0, kStep_s);
    EXPECT_EQ(intervals.front().gnss_class, "fixed");
    EXPECT_TRUE(intervals.front().error_m.isZero());
    for (const Seen& interval : intervals) {
      const Bounds& limit = limits.at(interval.gnss_class);
      EXPECT_GT(interval.length_s, limit.lowest - 1.01 * kStep_s) << interval.gnss_class;
      EXPECT_LT(interval.length_s, limit.highest + 1.01 * kStep_s) << interval.gnss_class;
    }
  }
}

TEST(GpsUrban, comes_back_to_wrong_ambiguities_and_reflections_in_their_shares) {
  std::map<std::string, int> all;
  std::map<std::string, int> wrong;
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    const std::vector<Seen> intervals = intervals_of(seed, 1500.0, 1.0);
    for (std::size_t i = 1; i < intervals.size(); ++i) {
      const Seen& interval = intervals[i];
      const double level_m = interval.error_m.head<2>().norm();
      EXPECT_TRUE(interval.constant);
      ++all[interval.gnss_class];
      if (interval.error_m.isZero()) {
        continue;
      }
      ++wrong[interval.gnss_class];
      if (interval.gnss_class == "fixed") {
        EXPECT_GE(level_m, 0.4);
        EXPECT_LE(level_m, 1.6);
        EXPECT_EQ(interval.error_m.z(), 0.0);
      } else {
        EXPECT_GE(level_m, 3.0);
        EXPECT_LE(level_m, 12.0);
      }
    }
  }
  const double fixed = static_cast<double>(wrong["fixed"]) / all["fixed"];
  EXPECT_NEAR(fixed, 0.15, share_tolerance(0.15, all["fixed"]));
  const double code = static_cast<double>(wrong["code"]) / all["code"];
  EXPECT_NEAR(code, 0.4, share_tolerance(0.4, all["code"]));
  EXPECT_EQ(wrong["float"], 0);
}

TEST(GpsUrban, is_silent_without_a_solution_unless_it_shall_say_so) {
  const Scenario silent = scenario_with_fault(kUrban);
  const Scenario told = scenario_with_fault(kUrban + ", silent: false");
  int none = 0;
  for (double t_s = 0.0; t_s < 1000.0; t_s += 1.0) {
    const GnssEpoch epoch = fix_at(silent, t_s);
    EXPECT_EQ(epoch.lost, epoch.gnss_class == "none");
    EXPECT_FALSE(fix_at(told, t_s).lost);
    EXPECT_EQ(fix_at(told, t_s).gnss_class, epoch.gnss_class);
    none += epoch.lost ? 1 : 0;
  }
  EXPECT_GT(none, 0);
}

}  // namespace trigpoint::simulator
