// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// GPS faults as the overlays of the scenarios combine them.
#include "trigpoint/geodesy/local_frame.hpp"

#include "entries.hpp"
#include "faults.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

double level_m(const GnssEpoch& fix) {
  return fix.extra_error_m.head<2>().norm();
}

}  // namespace

TEST(GpsWander, goes_5_m_off_and_back_in_20_to_60_s_each_way_without_a_jump) {
  const Scenario scenario = load_scenario("short+frozen_covariance");
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    double last_end_s = 60.0;
    double before_m = 0.0;
    bool out = true;
    int ways = 0;
    for (double t_s = 60.0; t_s < 515.0; t_s += kPeriod_s) {
      const GnssEpoch fix = fix_at(scenario, t_s, seed);
      const double now_m = level_m(fix);
      ASSERT_LE(now_m, 5.0 + 1e-9);
      // The steepest of a smooth step is 1.5 times its mean, 5 m in 20 s.
      ASSERT_LT(std::abs(now_m - before_m), 1.5 * 5.0 / 20.0 * kPeriod_s + 1e-9) << t_s;
      ASSERT_EQ(*fix.report.variance_enu_m2, Eigen::Vector3d(1e-4, 1e-4, 4e-4));
      if (out ? now_m < before_m : now_m > before_m) {
        EXPECT_GT(t_s - last_end_s, 20.0 - 2.0 * kPeriod_s);
        EXPECT_LT(t_s - last_end_s, 60.0 + 2.0 * kPeriod_s);
        EXPECT_NEAR(before_m, out ? 5.0 : 0.0, 0.02);
        last_end_s = t_s;
        out = !out;
        ++ways;
      }
      before_m = now_m;
    }
    EXPECT_GE(ways, 7) << seed;
  }
  EXPECT_EQ(level_m(fix_at(scenario, 59.9)), 0.0);
}

TEST(GpsWrongFix, is_2_to_8_m_off_for_10_to_40_s_and_right_in_between) {
  const Scenario scenario = load_scenario("short+wrong_fix");
  double wrong_s = 0.0;
  double right_s = 0.0;
  constexpr double kStep_s = 0.1;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    double since_s = 30.0;
    double size_m = 0.0;
    for (double t_s = 30.0; t_s < 1500.0; t_s += kStep_s) {
      const GnssEpoch fix = fix_at(scenario, t_s, seed);
      ASSERT_EQ(fix.gnss_class, "fixed");
      ASSERT_EQ(fix.report.variance_enu_m2->x(), 1e-4);
      const double now_m = level_m(fix);
      ASSERT_TRUE(now_m == 0.0 || (now_m >= 2.0 && now_m <= 8.0)) << now_m;
      (now_m > 0.0 ? wrong_s : right_s) += kStep_s;
      if (now_m == size_m) {
        continue;
      }
      const double length_s = t_s - since_s;
      ASSERT_GT(length_s, (size_m > 0.0 ? 10.0 : 15.0) - 2.0 * kStep_s);
      ASSERT_LT(length_s, (size_m > 0.0 ? 40.0 : 45.0) + 2.0 * kStep_s);
      size_m = now_m;
      since_s = t_s;
    }
  }
  // Means of 25 s wrong and 30 s right; about 540 of both, so 5 % is five standard deviations.
  EXPECT_NEAR(wrong_s / (wrong_s + right_s), 25.0 / 55.0, 0.05 * 25.0 / 55.0 + 0.02);
}

TEST(GpsInflate, admits_its_share_of_what_other_faults_added) {
  const Scenario scenario = scenario_with_fault(
      "type: gps_bias, offset_enu_m: [3, 4, 2]}\n  - {type: gps_inflate, share: 0.4");
  const Eigen::Vector3d variance = *fix_at(scenario, 1.0).report.variance_enu_m2;
  // 0.4 * 5 m / sqrt(2) an axis, besides 14 and 24 mm.
  EXPECT_NEAR(variance.x(), 2.0 + 0.014 * 0.014, 1e-12);
  EXPECT_NEAR(variance.y(), 2.0 + 0.014 * 0.014, 1e-12);
  EXPECT_NEAR(variance.z(), 0.64 + 0.024 * 0.024, 1e-12);
}

TEST(GpsChanges, put_errors_of_metres_and_a_part_of_them_into_the_covariance_between_houses) {
  const Scenario scenario = load_scenario("short+urban_multipath");
  double error = 0.0;
  double reported = 0.0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const GnssEpoch fix = fix_at(scenario, 100.0, seed);
    error += fix.extra_error_m.head<2>().squaredNorm();
    reported += fix.report.variance_enu_m2->head<2>().sum();
  }
  EXPECT_GT(std::sqrt(error / 100.0), 1.5);
  EXPECT_NEAR(std::sqrt(reported / error), 0.4, 0.01);
}

TEST(GpsChanges, lift_the_height_after_a_minute) {
  const Scenario step = load_scenario("short+height_step");
  EXPECT_EQ(fix_at(step, 59.9).extra_error_m.z(), 0.0);
  EXPECT_EQ(fix_at(step, 60.0).extra_error_m, Eigen::Vector3d(0.0, 0.0, 30.0));
  const Scenario drift = load_scenario("short+height_drift");
  EXPECT_NEAR(fix_at(drift, 90.0).extra_error_m.z(), 3.0, 1e-9);
}

TEST(GpsChanges, deliver_the_same_fixes_late_shuffled_and_again) {
  const auto sorted =
      messages_of<GnssFix>(entries_of(load_scenario("campus_twice"), 1, 60.0, false));
  const auto shuffled = messages_of<GnssFix>(
      entries_of(load_scenario("campus_twice+shuffled_fixes"), 1, 60.0, false));
  int backwards = 0;
  std::vector<Nanoseconds> stamps;
  for (std::size_t i = 0; i < shuffled.size(); ++i) {
    backwards += i > 0 && shuffled[i].stamp_ns < shuffled[i - 1].stamp_ns ? 1 : 0;
    stamps.push_back(shuffled[i].stamp_ns);
  }
  const auto n = static_cast<double>(sorted.size());
  EXPECT_NEAR(static_cast<double>(shuffled.size()) / n, 1.2, share_tolerance(0.2, n));
  EXPECT_GT(backwards, 30);
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  ASSERT_EQ(stamps.size(), sorted.size());
  for (const GnssFix& fix : shuffled) {
    const auto same = std::find_if(sorted.begin(), sorted.end(), [&](const GnssFix& other) {
      return other.stamp_ns == fix.stamp_ns;
    });
    ASSERT_NE(same, sorted.end());
    EXPECT_EQ(same->latitude_deg, fix.latitude_deg);
  }
}

TEST(TrueFixes, tell_what_was_lost_and_by_how_much_the_others_are_off) {
  constexpr double kNoise_m = 0.15;  // six sigmas of a fixed solution's height
  const Scenario scenario = load_scenario("campus+wrong_fix");
  const auto reader = open_scenario(scenario, 1, std::nullopt, {false});
  const auto truths = reader->true_fixes();
  const auto messages = messages_of<GnssFix>(all_of(*reader));
  const geodesy::LocalFrame frame(scenario.datum);
  EXPECT_EQ(truths.size(), reader->true_fixes().size());
  std::size_t delivered = 0;
  bool any_wrong = false;
  for (const FixTruth& truth : truths) {
    const auto message = std::find_if(messages.begin(), messages.end(), [&](const GnssFix& fix) {
      return fix.stamp_ns == truth.stamp_ns;
    });
    ASSERT_EQ(message == messages.end(), truth.lost);
    if (truth.lost) {
      EXPECT_NEAR(seconds(scenario, truth.stamp_ns), 45.0, 10.1);
      continue;
    }
    ++delivered;
    any_wrong = any_wrong || truth.fault_error_enu_m.norm() > 2.0;
    const auto place =
        frame.to_map({message->latitude_deg, message->longitude_deg, message->altitude_m});
    ASSERT_LT((*place - truth.antenna_map_m - truth.fault_error_enu_m).norm(), kNoise_m);
  }
  EXPECT_EQ(delivered, messages.size());
  EXPECT_TRUE(any_wrong);
}

TEST(GpsChanges, bring_the_first_fix_after_300_m) {
  const Scenario scenario = load_scenario("campus_late_gps");
  const auto fixes = messages_of<GnssFix>(entries_of(scenario, 1, 120.0, false));
  const auto truth = make_truth(scenario, 1);
  double driven_m = 0.0;
  Eigen::Vector3d last = truth->at(truth->first_ns()).T_map_base.p;
  for (Nanoseconds ns = truth->first_ns(); ns < fixes.front().stamp_ns; ns += 50'000'000) {
    const Eigen::Vector3d now = truth->at(ns).T_map_base.p;
    driven_m += (now - last).norm();
    last = now;
  }
  EXPECT_NEAR(driven_m, 303.0, 5.0);
}

}  // namespace trigpoint::simulator
