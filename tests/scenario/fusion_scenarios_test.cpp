// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The scenarios of the fusion table hold what its rows say, with every seed of the table.
#include "fusion_drive.hpp"
#include "fusion_rows.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace trigpoint::fusion_table {
namespace {

constexpr std::uint64_t kSeeds = 5;
constexpr double kFixPeriod_s = 0.2;
constexpr double kScenarioRounding = 1e-9;

Drive drive_of(const std::string& scenario, std::uint64_t seed) {
  cli::InputOptions input;
  input.log = scenario;
  input.seed = seed;
  return without_runs(input);
}

double length_s(const evaluation::Window& window) {
  return to_seconds(window.end_ns - window.begin_ns);
}

double since_start_s(const Drive& drive, Nanoseconds stamp_ns) {
  return to_seconds(stamp_ns - drive.truth->first_ns());
}

double driven_m(const Drive& drive, Nanoseconds from_ns, Nanoseconds to_ns) {
  constexpr Nanoseconds kStep_ns = 20'000'000;
  double sum_m = 0.0;
  for (Nanoseconds ns = from_ns; ns + kStep_ns <= to_ns; ns += kStep_ns) {
    sum_m +=
        (drive.truth->at(ns + kStep_ns).T_map_base.p - drive.truth->at(ns).T_map_base.p).norm();
  }
  return sum_m;
}

std::vector<evaluation::Window> wrong_stretches(const Drive& drive, double above_m) {
  return stretches(drive, [above_m](const simulator::FixTruth& fix) {
    return fix.fault_error_enu_m.norm() > above_m;
  });
}

std::set<std::string> scenarios() {
  std::set<std::string> names;
  for (const Row& row : rows()) {
    if (!row.score_map) {
      names.insert(row.scenario);
    }
  }
  return names;
}

TEST(FusionScenarios, have_gps_at_5_hz) {
  for (const std::string& scenario : scenarios()) {
    const Drive drive = drive_of(scenario, 1);
    ASSERT_GT(drive.fixes.size(), 100U) << scenario;
    for (std::size_t i = 1; i < drive.fixes.size(); ++i) {
      ASSERT_NEAR(to_seconds(drive.fixes[i].stamp_ns - drive.fixes[i - 1].stamp_ns),
                  kFixPeriod_s,
                  kScenarioRounding)
          << scenario;
    }
  }
}

TEST(FusionScenarios, drive_the_campus_loop_twice_without_a_fault) {
  constexpr double kLoop_m = 650.0;
  const Drive drive = drive_of("campus_twice", 1);
  EXPECT_NEAR(driven_m(drive, drive.truth->first_ns(), drive.truth->last_ns()),
              2.0 * kLoop_m,
              0.02 * 2.0 * kLoop_m);
  EXPECT_TRUE(outages(drive).empty());
  EXPECT_TRUE(wrong_stretches(drive, 0.0).empty());
}

TEST(FusionScenarios, lose_gps_indoors_for_the_time_said_at_1_2_m_per_s) {
  for (const double outage_s : {60.0, 120.0}) {
    const Drive drive = drive_of(outage_s == 60.0 ? "indoor_60" : "indoor_120", 1);
    const auto windows = outages(drive);
    ASSERT_EQ(windows.size(), 1U);
    EXPECT_NEAR(length_s(windows[0]), outage_s, 1.5 * kFixPeriod_s);
    EXPECT_NEAR(
        driven_m(drive, windows[0].begin_ns, windows[0].end_ns) / length_s(windows[0]), 1.2, 0.01);
  }
}

TEST(FusionScenarios, lose_gps_three_times_in_2_5_km) {
  const Drive drive = drive_of("long_drive", 1);
  EXPECT_NEAR(driven_m(drive, drive.truth->first_ns(), drive.truth->last_ns()), 2500.0, 100.0);
  const auto windows = outages(drive);
  ASSERT_EQ(windows.size(), 3U);
  for (const auto& window : windows) {
    EXPECT_NEAR(length_s(window), 60.0, 1.5 * kFixPeriod_s);
  }
}

TEST(FusionScenarios, hold_a_whole_stretch_of_wrong_fixes) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Drive drive = drive_of("campus+wrong_fix", seed);
    double longest_s = 0.0;
    for (const auto& window : wrong_stretches(drive, 0.0)) {
      const bool whole = window.end_ns < drive.truth->last_ns();
      longest_s = whole ? std::max(longest_s, length_s(window)) : longest_s;
    }
    EXPECT_GE(longest_s, 10.0) << seed;
    EXPECT_LE(longest_s, 40.0 + kFixPeriod_s) << seed;
    for (const simulator::FixTruth& fix : drive.fixes) {
      const double error_m = fix.fault_error_enu_m.norm();
      ASSERT_TRUE(error_m == 0.0 || (error_m >= 2.0 && error_m <= 8.0)) << error_m;
    }
  }
}

TEST(FusionScenarios, wander_5_m_off_from_right_fixes_without_a_jump) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Drive drive = drive_of("campus+frozen_covariance", seed);
    double largest_m = 0.0;
    double last_m = 0.0;
    for (const simulator::FixTruth& fix : drive.fixes) {
      const double now_m = fix.fault_error_enu_m.norm();
      ASSERT_LT(now_m - last_m, 1.5 * 5.0 / 20.0 * kFixPeriod_s + kScenarioRounding);
      ASSERT_FALSE(fix.lost && now_m > 0.0);
      largest_m = std::max(largest_m, now_m);
      last_m = now_m;
    }
    EXPECT_GT(largest_m, 4.9) << seed;
  }
}

TEST(FusionScenarios, lift_the_height_after_60_s_only) {
  for (const char* change : {"height_step", "height_drift"}) {
    const Drive drive = drive_of(std::string("campus+") + change, 1);
    for (const simulator::FixTruth& fix : drive.fixes) {
      const double late_s = since_start_s(drive, fix.stamp_ns) - 60.0;
      const double lift_m = std::string(change) == "height_step" ? 30.0 : 0.1 * late_s;
      ASSERT_NEAR(fix.fault_error_enu_m.z(), late_s < 0.0 ? 0.0 : lift_m, kScenarioRounding);
      ASSERT_EQ(fix.fault_error_enu_m.head<2>().norm(), 0.0);
    }
  }
}

TEST(FusionScenarios, have_a_fair_gps_all_along_the_smooth_walls) {
  for (const char* scenario : {"tunnel_gps", "corridor_gps"}) {
    const Drive drive = drive_of(scenario, 1);
    std::size_t inside = 0;
    for (const simulator::FixTruth& fix : drive.fixes) {
      const Eigen::Vector3d& p = fix.antenna_map_m;
      if (std::abs(p.y() - 50.0) < 1.5 && p.x() > 70.0 && p.x() < 450.0) {
        ASSERT_FALSE(fix.lost);
        ASSERT_EQ(fix.gnss_class, "float");
        ++inside;
      }
    }
    EXPECT_GT(inside, 300U);
  }
}

TEST(FusionScenarios, deliver_the_same_fixes_when_they_come_late_shuffled_or_again) {
  const Drive plain = drive_of("campus", 1);
  for (const char* change : {"late_fixes", "shuffled_fixes", "duplicated_fixes"}) {
    const Drive changed = drive_of(std::string("campus+") + change, 1);
    ASSERT_EQ(changed.received.size(), plain.received.size());
    for (std::size_t i = 0; i < plain.received.size(); ++i) {
      ASSERT_EQ(changed.received[i].stamp_ns, plain.received[i].stamp_ns);
      ASSERT_EQ(changed.received[i].error_map_m, plain.received[i].error_map_m);
    }
  }
}

TEST(FusionDrive, runs_every_mode_and_the_sorted_fixes_on_the_same_sensors) {
  DriveOptions options;
  options.input.log = "short";
  options.input.seed = 1;
  options.input.duration_s = 14.0;
  options.modes = {"lio", "hard"};
  options.sorted = true;
  const Drive result = drive(options);
  const fusion_table::Run& lio = result.runs.at("lio");
  const fusion_table::Run& hard = result.runs.at("hard");
  ASSERT_FALSE(hard.fused.empty());
  EXPECT_EQ(hard.fused.size(), hard.pairs.size());
  EXPECT_EQ(lio.odom.size(), hard.odom.size());
  EXPECT_LT(evaluation::absolute_error(hard.pairs).position_m.max, 0.5);
  EXPECT_GT(hard.nees_pose, 0.0);
  const auto rows_of = [](const fusion_table::Run& run) {
    return std::count_if(run.judgements.begin(), run.judgements.end(), [](const auto& judged) {
      return judged.second.moves[0];
    });
  };
  EXPECT_GT(rows_of(hard), 10);
  EXPECT_EQ(rows_of(lio), 0);
  // In time and in order they come anyway: only the latency's jitter is gone.
  EXPECT_EQ(rows_of(result.sorted_runs.at("hard")), rows_of(hard));
  EXPECT_LT(evaluation::largest_difference_m(hard.fused, result.sorted_runs.at("hard").fused, {}),
            0.02);
}

TEST(FusionModes, are_those_of_the_gate) {
  const auto modes = known_modes();
  for (const char* mode : {"lio", "fusion", "literal", "hard"}) {
    EXPECT_NE(std::find(modes.begin(), modes.end(), mode), modes.end());
  }
  EXPECT_NE(std::find(modes.begin(), modes.end(), fusion_gate::Config{}.mode), modes.end());
}

}  // namespace
}  // namespace trigpoint::fusion_table
