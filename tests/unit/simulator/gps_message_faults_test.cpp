// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Faults of messages: what they report, when they come, how often. Always against the same drive
// without the fault.
#include "entries.hpp"
#include "fault.hpp"
#include "faults.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace trigpoint::simulator {

namespace {

constexpr double kDuration_s = 20.0;
constexpr std::size_t kFixes = 100;

struct Arrived {
  Nanoseconds receive_ns;
  GnssFix fix;
};

/// Fixes in order of arrival.
std::vector<Arrived> arrivals(const Scenario& scenario) {
  std::vector<Arrived> result;
  for (const recording::LogEntry& entry : entries_of(scenario, 1, kDuration_s, false)) {
    if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      result.push_back({entry.receive_ns, *fix});
    }
  }
  return result;
}

std::vector<Arrived> arrivals(const std::string& fault) {
  return arrivals(scenario_with_fault(fault));
}

bool same_place(const GnssFix& a, const GnssFix& b) {
  return a.latitude_deg == b.latitude_deg && a.longitude_deg == b.longitude_deg &&
         a.altitude_m == b.altitude_m;
}

}  // namespace

TEST(GpsFrozenCovariance, reports_its_sigma_while_the_fix_runs_away) {
  const auto fixes = arrivals(small_scenario(
      "faults:\n  - {type: gps_multipath, start_s: 5.0, ramp_mps: 0.25, ramp_limit_m: 5.0}\n"
      "  - {type: gps_class, start_s: 8.0, gnss_class: code}\n"
      "  - {type: gps_frozen_covariance, start_s: 5.0, sigma_enu_m: [0.02, 0.03, 0.05]}\n"));
  for (const Arrived& arrived : fixes) {
    const bool active = seconds(small_scenario(), arrived.fix.stamp_ns) >= 5.0;
    EXPECT_NEAR(std::sqrt(arrived.fix.covariance_enu_m2(0, 0)), active ? 0.02 : 0.014, 1e-12);
    EXPECT_NEAR(std::sqrt(arrived.fix.covariance_enu_m2(2, 2)), active ? 0.05 : 0.024, 1e-12);
    EXPECT_EQ(arrived.fix.covariance_type, CovarianceType::kDiagonalKnown);
  }
}

TEST(GpsFrozenFix, repeats_the_last_good_fix_under_new_stamps) {
  const auto clean = arrivals(small_scenario());
  const auto frozen = arrivals("type: gps_frozen_fix, start_s: 5.0, duration_s: 4.0");
  ASSERT_EQ(frozen.size(), clean.size());
  int repeated = 0;
  for (std::size_t i = 1; i < clean.size(); ++i) {
    const double t_s = seconds(small_scenario(), clean[i].fix.stamp_ns);
    const bool active = t_s >= 5.0 && t_s < 9.0;
    EXPECT_EQ(frozen[i].fix.stamp_ns, clean[i].fix.stamp_ns);
    EXPECT_TRUE(same_place(frozen[i].fix, active ? frozen[i - 1].fix : clean[i].fix)) << t_s;
    repeated += active ? 1 : 0;
  }
  EXPECT_EQ(repeated, 20);
}

TEST(GpsJitter, shifts_stamps_and_latency_uniformly_within_their_half_widths) {
  const Scenario scenario = scenario_with_fault("type: gps_jitter, stamp_s: 0.03, latency_s: 0.05");
  constexpr int kDraws = 5000;
  double stamp = 0.0;
  double latency = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    GnssEpoch epoch;
    epoch.stamp_ns = scenario.start_ns() + i;
    epoch.latency_s = 0.2;
    FaultSchedule(scenario.faults, scenario.start_ns(), 1).apply(epoch);
    const double shift_s = to_seconds(epoch.stamp_shift_ns);
    ASSERT_LE(std::abs(shift_s), 0.03);
    ASSERT_LE(std::abs(epoch.latency_s - 0.2), 0.05);
    stamp += std::pow(shift_s / 0.03, 2) / kDraws;
    latency += std::pow((epoch.latency_s - 0.2) / 0.05, 2) / kDraws;
  }
  // The square of a uniform number in [-1, 1] has mean 1/3 and variance 4/45.
  const double tolerance = 5.0 * std::sqrt(4.0 / 45.0 / kDraws);
  EXPECT_NEAR(stamp, 1.0 / 3.0, tolerance);
  EXPECT_NEAR(latency, 1.0 / 3.0, tolerance);
}

TEST(GpsJitter, keeps_the_log_in_order_of_arrival_and_never_before_the_measurement) {
  const Scenario scenario = scenario_with_fault("type: gps_jitter, stamp_s: 0.0, latency_s: 0.5");
  Nanoseconds arrived_ns = 0;
  for (const recording::LogEntry& entry : entries_of(scenario, 1, kDuration_s, false)) {
    ASSERT_GE(entry.receive_ns, arrived_ns);
    arrived_ns = entry.receive_ns;
    if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      ASSERT_GE(entry.receive_ns, fix->stamp_ns);
    }
  }
}

TEST(GpsReorder, lets_exactly_the_wanted_number_of_newer_fixes_overtake) {
  for (const int behind : {1, 3}) {
    const auto clean = arrivals(small_scenario());
    const auto fixes = arrivals("type: gps_reorder, start_s: 5.0, duration_s: 0.2, share: 1.0, " +
                                std::string("behind: ") + std::to_string(behind));
    ASSERT_EQ(fixes.size(), kFixes);
    std::size_t moved = 0;
    while (same_place(fixes[moved].fix, clean[moved].fix)) {
      ++moved;
    }
    EXPECT_NEAR(seconds(small_scenario(), clean[moved].fix.stamp_ns), 5.06, 1e-9);
    const auto late = moved + static_cast<std::size_t>(behind);
    EXPECT_EQ(fixes[late].fix.stamp_ns, clean[moved].fix.stamp_ns);
    EXPECT_TRUE(same_place(fixes[late].fix, clean[moved].fix));
    EXPECT_EQ(fixes[late + 1].fix.stamp_ns, clean[late + 1].fix.stamp_ns);
  }
}

TEST(GpsReorder, delays_its_share) {
  const Scenario scenario = scenario_with_fault("type: gps_reorder, share: 0.2");
  constexpr int kDraws = 5000;
  int late = 0;
  for (int i = 0; i < kDraws; ++i) {
    late += fix_at(scenario, i * kPeriod_s).latency_s > 0.0 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(late) / kDraws, 0.2, share_tolerance(0.2, kDraws));
}

TEST(GpsDuplicate, repeats_fixes_bit_by_bit_and_counts_them_in_the_summary) {
  const Scenario scenario =
      scenario_with_fault("type: gps_duplicate, share: 0.3, copies: 2, apart_s: 0.015");
  const auto clean = arrivals(small_scenario());
  const auto fixes = arrivals(scenario);
  std::size_t at = 0;
  int repeated = 0;
  for (const Arrived& original : clean) {
    ASSERT_LT(at, fixes.size());
    EXPECT_EQ(fixes[at].receive_ns, original.receive_ns);
    std::size_t copies = 0;
    while (at + copies < fixes.size() && fixes[at + copies].fix.stamp_ns == original.fix.stamp_ns) {
      EXPECT_TRUE(same_place(fixes[at + copies].fix, original.fix));
      EXPECT_NEAR(to_seconds(fixes[at + copies].receive_ns - original.receive_ns),
                  0.015 * static_cast<double>(copies),
                  2e-9);
      ++copies;
    }
    EXPECT_TRUE(copies == 1 || copies == 3) << copies;
    repeated += copies == 3 ? 1 : 0;
    at += copies;
  }
  EXPECT_EQ(at, fixes.size());
  EXPECT_NEAR(repeated / 100.0, 0.3, share_tolerance(0.3, kFixes));
  EXPECT_EQ(open_scenario(scenario, 1, kDuration_s, {false})->summary().topics[1].messages,
            fixes.size());
}

TEST(GpsLate, delays_the_arrival_and_keeps_the_stamp) {
  const auto clean = arrivals(small_scenario());
  const auto fixes = arrivals("type: gps_late, delay_s: 0.5");
  ASSERT_EQ(fixes.size(), clean.size());
  for (std::size_t i = 0; i < clean.size(); ++i) {
    EXPECT_EQ(fixes[i].fix.stamp_ns, clean[i].fix.stamp_ns);
    EXPECT_NEAR(to_seconds(fixes[i].receive_ns - clean[i].receive_ns), 0.5, 2e-9);
  }
}

TEST(GpsClock, steps_the_stamps_for_a_while_and_nothing_else) {
  for (const double shift_s : {3600.0, -3600.0, -10.0, 0.25}) {
    const auto clean = arrivals(small_scenario());
    const auto fixes = arrivals("type: gps_clock, start_s: 5.0, duration_s: 6.0, shift_s: " +
                                std::to_string(shift_s));
    ASSERT_EQ(fixes.size(), clean.size());
    for (std::size_t i = 0; i < clean.size(); ++i) {
      const double t_s = seconds(small_scenario(), clean[i].fix.stamp_ns);
      const bool active = t_s >= 5.0 && t_s < 11.0;
      EXPECT_EQ(fixes[i].fix.stamp_ns - clean[i].fix.stamp_ns, active ? from_seconds(shift_s) : 0);
      EXPECT_EQ(fixes[i].receive_ns, clean[i].receive_ns);
      EXPECT_TRUE(same_place(fixes[i].fix, clean[i].fix));
    }
  }
}

TEST(GpsClock, can_stop) {
  const auto fixes = arrivals("type: gps_clock, start_s: 5.0, shift_s: 0.0, stopped: true");
  EXPECT_NEAR(seconds(small_scenario(), fixes.back().fix.stamp_ns), 5.0, 1e-6);
  EXPECT_NEAR(seconds(small_scenario(), fixes[30].fix.stamp_ns), 5.0, 1e-6);
}

TEST(GpsNoCovariance, reports_zeros_of_unknown_type_at_the_same_place) {
  const auto clean = arrivals(small_scenario());
  const auto fixes = arrivals("type: gps_no_covariance");
  for (std::size_t i = 0; i < clean.size(); ++i) {
    EXPECT_EQ(fixes[i].fix.covariance_type, CovarianceType::kUnknown);
    EXPECT_TRUE(fixes[i].fix.covariance_enu_m2.isZero(0.0));
    EXPECT_EQ(fixes[i].fix.status, clean[i].fix.status);
    EXPECT_TRUE(same_place(fixes[i].fix, clean[i].fix));
  }
}

TEST(GpsGarbage, writes_what_drivers_write) {
  const auto first = [](const std::string& kind) {
    return arrivals("type: gps_garbage, kind: " + kind).front().fix;
  };
  const GnssFix clean = arrivals(small_scenario()).front().fix;
  EXPECT_TRUE(std::isnan(first("nan").latitude_deg) && std::isnan(first("nan").longitude_deg));
  EXPECT_EQ(first("nan").status, clean.status);
  EXPECT_EQ(first("zero").latitude_deg, 0.0);
  EXPECT_EQ(first("zero").altitude_m, 0.0);
  EXPECT_EQ(first("out_of_range").longitude_deg, -2e10);
  EXPECT_TRUE(std::isinf(first("infinite").longitude_deg));
  EXPECT_TRUE(std::isnan(first("nan_height").altitude_m));
  EXPECT_EQ(first("nan_height").latitude_deg, clean.latitude_deg);
  EXPECT_EQ(first("negative_variance").covariance_enu_m2(1, 1), -1.0);
  EXPECT_TRUE(std::isnan(first("nan_variance").covariance_enu_m2(0, 0)));
  EXPECT_TRUE(same_place(first("nan_variance"), clean));
}

TEST(GpsOutage, can_lose_a_share_only) {
  const Scenario scenario = scenario_with_fault("type: gps_outage, share: 0.2");
  constexpr int kDraws = 5000;
  int lost = 0;
  for (int i = 0; i < kDraws; ++i) {
    lost += fix_at(scenario, i * kPeriod_s).lost ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(lost) / kDraws, 0.2, share_tolerance(0.2, kDraws));
}

TEST(EveryFault, leaves_what_is_measured_outside_its_interval_as_it_was) {
  const auto clean = entries_of(small_scenario(), 1, 12.0, false);
  for (const auto& [name, make] : fault_registry()) {
    const Scenario scenario =
        scenario_with_fault("type: " + name + ", start_s: 5.0, duration_s: 3.0");
    std::multiset<std::string> delivered;
    for (const recording::LogEntry& entry : entries_of(scenario, 1, 12.0, false)) {
      delivered.insert(bytes_of(entry));
    }
    int missing_outside = 0;
    int missing_inside = 0;
    for (const recording::LogEntry& entry : clean) {
      const auto* fix = std::get_if<GnssFix>(&entry.measurement);
      const double t_s =
          seconds(scenario,
                  fix != nullptr ? fix->stamp_ns : std::get<ImuSample>(entry.measurement).stamp_ns);
      const bool missing = delivered.count(bytes_of(entry)) == 0;
      const bool inside = t_s >= 5.0 && t_s < 8.0;
      missing_outside += missing && !inside ? 1 : 0;
      missing_inside += missing && inside ? 1 : 0;
    }
    EXPECT_EQ(missing_outside, 0) << name;
    const bool rare = name == "gps_reorder" || name == "gps_duplicate" || name == "gps_spike";
    const bool unfelt = name == "gps_urban" ||       // begins fixed
                        name == "gps_inflate" ||     // of others' errors, and there are none
                        name.starts_with("lidar_");  // there is none
    const bool by_size = name == "gps_bias" || name == "imu_saturation" ||  // 0 or wide by default
                         name == "gps_frozen_covariance";                   // as the fixed class
    EXPECT_TRUE(missing_inside > 0 || rare || unfelt || by_size) << name;
  }
}

TEST(EveryFault, gives_the_same_bits_again_and_the_same_imu_and_fixes_without_the_lidar) {
  std::string all = "faults:\n";
  for (const auto& [name, make] : fault_registry()) {
    // What hides the others shall be over soon.
    const std::set<std::string> hiding{
        "gps_cluster", "gps_outage", "gps_frozen_fix", "gps_garbage", "imu_gap", "imu_stuck"};
    all += "  - {type: " + name + (hiding.count(name) > 0 ? ", duration_s: 0.5}\n" : "}\n");
  }
  const Scenario scenario = small_scenario(all);
  const auto with = entries_of(scenario, 3, 2.0, true);
  std::vector<recording::LogEntry> rest;
  std::copy_if(with.begin(), with.end(), std::back_inserter(rest), [](const auto& entry) {
    return !std::holds_alternative<PointCloudMessage>(entry.measurement);
  });
  EXPECT_GT(rest.size(), 200U);
  const auto without = entries_of(scenario, 3, 2.0, false);
  EXPECT_EQ(bytes_of(rest), bytes_of(without));
  EXPECT_EQ(bytes_of(without), bytes_of(entries_of(scenario, 3, 2.0, false)));
  EXPECT_NE(bytes_of(without), bytes_of(entries_of(scenario, 4, 2.0, false)));
}

}  // namespace trigpoint::simulator
