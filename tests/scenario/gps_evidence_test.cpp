// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the GPS filters must show, over seeds of the simulator: accuracy, drift, honesty of the
// published covariance, and what single faults do. The published filter (ekf15_strict) runs beside
// ours; it has no bounds. The consistency of the raw covariance is in gps_odometry_long_test.
#include "gps_drives.hpp"
#include "gps_table.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

namespace trigpoint {
namespace {

constexpr double kSettled_s = 30.0;  ///< heading found, wander of the receiver under way
constexpr double kFloor_m = 0.12;    ///< 3-D sigma that is never gone below: 0.05, 0.05, 0.10 m

constexpr std::size_t kEskf18 = 1;
constexpr std::size_t kStrict = 2;

/// TRIGPOINT_EVIDENCE_RUNS: fewer runs, to try something out.
int runs_of(int runs) {
  const char* fewer = std::getenv("TRIGPOINT_EVIDENCE_RUNS");
  return fewer == nullptr ? runs : std::min(runs, std::max(1, std::atoi(fewer)));
}

EvidenceTable& table() {
  return EvidenceTable::instance();
}

// Before main, so that the table is printed whatever test is chosen.
[[maybe_unused]] const EvidenceTable& kTable = table();

using AllRuns = std::vector<std::array<DriveSamples, 3>>;

AllRuns drive_scenario(int runs,
                       const std::string& name,
                       double duration_s,
                       const std::vector<std::string>& faults = {}) {
  const simulator::Scenario scenario = scenario_with(name, faults);
  return drive_seeds(runs_of(runs),
                     [&](std::uint64_t seed) { return drive_all(scenario, seed, duration_s); });
}

Honesty honesty_of(const AllRuns& all, std::size_t filter, double from_s, double to_s = 1e9) {
  Honesty honesty;
  for (const auto& run : all) {
    honesty.add(run[filter], from_s, to_s);
  }
  return honesty;
}

/// What is published must bound the error, without being so large that it says nothing.
void expect_honest(const std::string& what, std::size_t filter, const Honesty& honesty) {
  const std::string name = kFilters[filter];
  table().note(what + ", rms", name, honesty.rms_m(), "m");
  table().note(what + ", worst", name, honesty.worst_m(), "m");
  const double ratio = honesty.median_sigma_m() / honesty.rms_m();
  if (filter == kStrict) {
    table().note(what + ", ANEES", name, honesty.anees(), "");
    table().note(what + ", inside 1.96 sigma", name, honesty.inside(), "");
    table().note(what + ", median sigma / rms", name, ratio, "");
    return;
  }
  table().at_most(what + ", ANEES", name, honesty.anees(), 2.0, "");
  table().at_least(what + ", inside 1.96 sigma", name, honesty.inside(), 0.95, "");
  if (honesty.median_sigma_m() <= kFloor_m) {
    table().note(what + ", median sigma (at the floor) / rms", name, ratio, "");
  } else {
    table().at_most(what + ", median sigma / rms", name, ratio, 4.0, "");
  }
}

// ---- accuracy -----------------------------------------------------------------------------------

struct AccuracyCase {
  const char* scenario;
  const char* what;
  double duration_s;
  double ekf15_m;
  double eskf18_m;
};

class Accuracy : public testing::TestWithParam<AccuracyCase> {};

TEST_P(Accuracy, is_that_of_the_receiver) {
  const AccuracyCase& c = GetParam();
  const AllRuns all = drive_scenario(10, c.scenario, c.duration_s);
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    const Honesty honesty = honesty_of(all, filter, kSettled_s);
    const std::string what = std::string(c.what) + ", rms";
    if (filter == kStrict) {
      table().note(what, kFilters[filter], honesty.rms_m(), "m");
    } else {
      table().at_most(
          what, kFilters[filter], honesty.rms_m(), filter == kEskf18 ? c.eskf18_m : c.ekf15_m, "m");
    }
    table().note(
        std::string(c.what) + ", inside 1.96 sigma", kFilters[filter], honesty.inside(), "");
  }
}

INSTANTIATE_TEST_SUITE_P(
    Rtk,
    Accuracy,
    testing::Values(AccuracyCase{"open_sky", "RTK 1.5 m/s", 480.0, 0.10, 0.03},
                    AccuracyCase{"open_sky_fast", "RTK 5 m/s", 480.0, 0.10, 0.03},
                    AccuracyCase{"circle", "circle 2 m/s 0.5 rad/s 2 Hz", 120.0, 0.10, 0.05}));

// ---- outages ------------------------------------------------------------------------------------

struct OutageCase {
  const char* scenario;
  const char* what;
  std::array<double, 3> limits_m;  ///< eskf18 at 10, 30, 60 s
};

/// A place of its own in every run: straights, turns and stops alike.
double outage_from_s(std::uint64_t seed) {
  return 60.0 + 7.0 * static_cast<double>((seed * 17) % 50);
}

class Outage : public testing::TestWithParam<OutageCase> {};

TEST_P(Outage, is_bridged_within_the_published_sigma) {
  const OutageCase& c = GetParam();
  const simulator::Scenario scenario = scenario_with(c.scenario, {});
  const AllRuns all = drive_seeds(runs_of(50), [&](std::uint64_t seed) {
    const double from_s = outage_from_s(seed);
    return drive_all(scenario, seed, from_s + 60.5, [&](double t) { return t < from_s; });
  });
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    const std::array<double, 3> ages_s{10.0, 30.0, 60.0};
    for (std::size_t k = 0; k < ages_s.size(); ++k) {
      Honesty at;
      for (std::size_t run = 0; run < all.size(); ++run) {
        at.add(sample_at(all[run][filter], outage_from_s(run + 1) + ages_s[k]));
      }
      const std::string what = std::string("outage, ") + c.what + ", " +
                               std::to_string(static_cast<int>(ages_s[k])) + " s";
      if (filter == kEskf18) {
        table().at_most(what + ", rms", kFilters[filter], at.rms_m(), c.limits_m[k], "m");
      } else {
        table().note(what + ", rms", kFilters[filter], at.rms_m(), "m");
      }
      table().note(what + ", median sigma", kFilters[filter], at.median_sigma_m(), "m");
      table().note(what + ", inside 1.96 sigma", kFilters[filter], at.inside(), "");
    }
    Honesty through;
    for (std::size_t run = 0; run < all.size(); ++run) {
      const double from_s = outage_from_s(run + 1);
      through.add(all[run][filter], from_s, from_s + 30.0);
    }
    expect_honest(std::string("outage to 30 s, ") + c.what, filter, through);
  }
}

INSTANTIATE_TEST_SUITE_P(Speeds,
                         Outage,
                         testing::Values(OutageCase{"open_sky", "1.5 m/s", {1.5, 4.0, 8.0}},
                                         OutageCase{"open_sky_fast", "5 m/s", {2.0, 8.0, 12.0}}));

// ---- town ---------------------------------------------------------------------------------------

TEST(Town, is_driven_with_an_honest_covariance) {
  const AllRuns all = drive_scenario(50, "urban", 480.0);
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    expect_honest("urban", filter, honesty_of(all, filter, kSettled_s));
  }
}

// ---- single faults on a receiver that was right -------------------------------------------------

constexpr double kFault_s = 120.0;

TEST(Fault, wrong_fix_of_one_metre_is_not_followed_in_silence) {
  constexpr double kLasts_s = 30.0;
  const AllRuns all = drive_scenario(
      20,
      "open_sky",
      kFault_s + kLasts_s + 60.0,
      {"{type: gps_wrong_fix, start_s: 120, duration_s: 30, lowest_m: 1.0, highest_m: 1.0}"});
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    double worst_m = 0.0;
    double told = 0.0;
    double count = 0.0;
    for (const auto& run : all) {
      for (const DriveSample& sample : run[filter]) {
        if (sample.time_s < kFault_s || sample.time_s > kFault_s + kLasts_s) {
          continue;
        }
        worst_m = std::max(worst_m, sample.error_m.norm());
        if (sample.time_s > kFault_s + 5.0) {
          count += 1.0;
          told += sample.sigma_m.head<2>().maxCoeff() >= 0.3 || sample.health != GpsHealth::kOk;
        }
      }
    }
    const double after_m = honesty_of(all, filter, kFault_s + kLasts_s + 20.0).rms_m();
    const std::string name = kFilters[filter];
    if (filter == kStrict) {
      table().note("wrong fix of 1 m, worst error", name, worst_m, "m");
      table().note("wrong fix of 1 m, told after 5 s", name, told / count, "");
      table().note("wrong fix of 1 m, rms from 20 s after it", name, after_m, "m");
    } else {
      table().at_most("wrong fix of 1 m, worst error", name, worst_m, 1.2, "m");
      table().at_least("wrong fix of 1 m, told after 5 s", name, told / count, 1.0, "");
      table().at_most("wrong fix of 1 m, rms from 20 s after it",
                      name,
                      after_m,
                      filter == kEskf18 ? 0.03 : 0.10,
                      "m");
    }
  }
}

class Spike : public testing::TestWithParam<int> {};

TEST_P(Spike, of_one_fix_moves_nothing) {
  const std::string size = std::to_string(GetParam());
  const AllRuns all = drive_scenario(20,
                                     "open_sky",
                                     kFault_s + 10.0,
                                     {"{type: gps_spike, start_s: 120, duration_s: 0.19, share: 1, "
                                      "lowest_m: " +
                                      size + ", highest_m: " + size + "}"});
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    double step_m = 0.0;
    for (const auto& run : all) {
      step_m = std::max(step_m, largest_step_m(run[filter], kFault_s, kFault_s + 3.0));
    }
    const std::string what = "spike of " + size + " m, largest step";
    if (filter == kStrict) {
      table().note(what, kFilters[filter], step_m, "m");
    } else {
      table().at_most(what, kFilters[filter], step_m, 0.3, "m");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, Spike, testing::Values(5, 15, 50, 700));

TEST(Fault, cluster_after_a_blackout_is_never_followed_in_silence) {
  constexpr double kCluster_s = 60.0 + 211.0;
  const AllRuns all = drive_scenario(10,
                                     "open_sky",
                                     kCluster_s + 24.0 + 60.0,
                                     {"{type: gps_cluster, start_s: 60, duration_s: 235, "
                                      "lowest_m: 700, highest_m: 700}"});
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    double silent = 0.0;
    double followed = 0.0;
    double least_ratio = 1e9;
    std::vector<double> of_innovation;
    double count = 0.0;
    for (const auto& run : all) {
      // What a filter can know of a wrong fix is how far it is from where the filter was. The dead
      // reckoning of 211 s has an error of its own, which may point towards the cluster.
      const Eigen::Vector2d before_m = sample_at(run[filter], kCluster_s - 0.1).error_m.head<2>();
      for (const DriveSample& sample : run[filter]) {
        const double t_s = sample.time_s - kCluster_s;
        if (t_s < 0.0 || t_s > 24.0) {
          continue;
        }
        count += 1.0;
        const Eigen::Vector2d error_m = sample.error_m.head<2>();
        if (error_m.norm() > 350.0) {  // nearer to the cluster than to the truth
          const double sigma_m = sample.sigma_m.head<2>().norm();
          followed += 1.0;
          silent += sample.health == GpsHealth::kOk;
          least_ratio = std::min(least_ratio, sigma_m / error_m.norm());
          of_innovation.push_back(sigma_m / (error_m - before_m).norm());
        }
      }
    }
    const std::string name = kFilters[filter];
    const double after_m = honesty_of(all, filter, kCluster_s + 24.0 + 40.0).rms_m();
    table().note("700 m cluster, share of its time followed", name, followed / count, "");
    table().note("700 m cluster, rms from 40 s after it", name, after_m, "m");
    if (filter == kStrict) {
      table().note("700 m cluster, followed with health OK", name, silent / count, "");
      table().note("700 m cluster, least sigma / error", name, least_ratio, "");
    } else {
      table().at_most("700 m cluster, followed with health OK", name, silent / count, 0.0, "");
      if (followed > 0.0) {
        // What is held is the innovation; the fixes go on to wander about it by some metres.
        std::sort(of_innovation.begin(), of_innovation.end());
        table().note("700 m cluster, sigma / innovation while followed, least",
                     name,
                     of_innovation.front(),
                     "");
        table().note("700 m cluster, sigma / innovation while followed, median",
                     name,
                     of_innovation[of_innovation.size() / 2],
                     "");
        table().note("700 m cluster, sigma / error while followed", name, least_ratio, "");
      }
    }
  }
}

/// What the filter alone can know of it; the gate compares with the LiDAR before 2 m.
TEST(Fault, multipath_ramp_and_what_is_published_of_it) {
  const AllRuns all = drive_scenario(
      20,
      "open_sky",
      kFault_s + 60.0,
      {"{type: gps_multipath, start_s: 120, duration_s: 60, ramp_mps: 0.2, ramp_limit_m: 8}"});
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    Honesty two;
    double told_s = 0.0;
    for (const auto& run : all) {
      two.add(sample_at(run[filter], kFault_s + 10.0));
      const auto told =
          std::find_if(run[filter].begin(), run[filter].end(), [](const DriveSample& sample) {
            return sample.time_s > kFault_s && sample.health != GpsHealth::kOk;
          });
      told_s += (told == run[filter].end() ? 60.0 : told->time_s - kFault_s) /
                static_cast<double>(all.size());
    }
    const Honesty end = honesty_of(all, filter, kFault_s + 40.0);
    table().note(
        "multipath 0.2 m/s, error when it is 2 m, rms", kFilters[filter], two.rms_m(), "m");
    table().note("multipath 0.2 m/s, not OK after, mean", kFilters[filter], told_s, "s");
    table().note("multipath of 8 m, rms", kFilters[filter], end.rms_m(), "m");
    table().note("multipath of 8 m, median sigma", kFilters[filter], end.median_sigma_m(), "m");
  }
}

TEST(Fault, wandering_height_stays_in_the_height) {
  const AllRuns all = drive_scenario(10,
                                     "open_sky",
                                     480.0,
                                     {"{type: gps_class, start_s: 20, gnss_class: sbas}",
                                      "{type: gps_height, start_s: 20, walk_m_per_sqrt_s: 1}"});
  const AllRuns without =
      drive_scenario(10, "open_sky", 480.0, {"{type: gps_class, start_s: 20, gnss_class: sbas}"});
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    const Honesty honesty = honesty_of(all, filter, kSettled_s);
    const Honesty calm = honesty_of(without, filter, kSettled_s);
    table().note("SBAS, level rms", kFilters[filter], calm.rms_level_m(), "m");
    table().note("SBAS, height rms", kFilters[filter], calm.rms_up_m(), "m");
    table().note("height walk of 20 m, level rms", kFilters[filter], honesty.rms_level_m(), "m");
    table().note("height walk of 20 m, height rms", kFilters[filter], honesty.rms_up_m(), "m");
    table().note(
        "height walk of 20 m, height inside 1.96 sigma", kFilters[filter], honesty.inside_up(), "");
  }
}

// ---- time ---------------------------------------------------------------------------------------

void rms_of(const simulator::Scenario& scenario, int runs, std::array<double, 3>& rms_m) {
  const AllRuns all = drive_seeds(
      runs_of(runs), [&](std::uint64_t seed) { return drive_all(scenario, seed, 240.0); });
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    rms_m[filter] = honesty_of(all, filter, kSettled_s).rms_m();
  }
}

struct TimeCase {
  const char* what;
  double latency_s;
  std::vector<std::string> faults;
  bool bounded{true};
};

TEST(Time, of_arrival_does_not_change_the_result) {
  constexpr int kRuns = 6;
  constexpr double kMostChange = 0.20;
  const auto with_latency = [](double latency_s, const std::vector<std::string>& faults) {
    simulator::Scenario scenario = scenario_with("open_sky_fast", faults);
    scenario.gnss.latency_s = latency_s;
    scenario.gnss.latency_jitter_s = 0.0;
    return scenario;
  };
  std::array<double, 3> before_m{};
  rms_of(with_latency(0.0, {}), kRuns, before_m);
  const std::vector<TimeCase> cases{
      {"latency 100 ms", 0.1, {}},
      {"latency 200 ms", 0.2, {}},
      {"latency 300 ms", 0.3, {}},
      {"arrival jitter of 20 ms", 0.1, {"{type: gps_jitter, stamp_s: 0, latency_s: 0.02}"}},
      {"reordered 5 %", 0.1, {"{type: gps_reorder, share: 0.05}"}},
      {"duplicated 5 %", 0.1, {"{type: gps_duplicate, share: 0.05}"}},
      {"lost 20 %", 0.1, {"{type: gps_outage, share: 0.2}"}},
      {"stamps wrong by up to 20 ms",
       0.1,
       {"{type: gps_jitter, stamp_s: 0.02, latency_s: 0}"},
       false},
  };
  for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
    table().note("5 m/s, no latency, rms", kFilters[filter], before_m[filter], "m");
  }
  for (const TimeCase& c : cases) {
    std::array<double, 3> rms_m{};
    rms_of(with_latency(c.latency_s, c.faults), kRuns, rms_m);
    for (std::size_t filter = 0; filter < kFilters.size(); ++filter) {
      const std::string what = std::string("5 m/s, ") + c.what + ", change of rms";
      const double change = rms_m[filter] / before_m[filter] - 1.0;
      if (filter == kStrict || !c.bounded) {
        table().note(what, kFilters[filter], change, "");
      } else {
        table().at_most(what, kFilters[filter], change, kMostChange, "");
      }
    }
  }
}

}  // namespace
}  // namespace trigpoint
