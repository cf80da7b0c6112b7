// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the GPS filters cost on a simulated drive of 200 Hz IMU. Figures are printed, never
// asserted: the aims are 5 % of one core, and a p99 of 2 ms from IMU in to odometry out.
//   core_percent   processor time of all messages, of the duration of the drive
//   p50, p99, max  from the arrival of an IMU sample to its odometry, on one thread that is still
//                  busy when a fix has just been rewound: the waiting is counted
//   fix_max        one fix alone, rewind and all that comes after it done again
// Times are the thread's own, so that what else the machine does matters little.
#include "trigpoint/gps_odometry/gps_odometry.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint {
namespace {

constexpr double kDuration_s = 120.0;

struct Case {
  double rate_hz;
  double latency_s;
};

struct Drive {
  simulator::Scenario scenario;
  std::vector<recording::LogEntry> entries;
};

Drive drive_of(const Case& c) {
  Drive drive;
  drive.scenario = simulator::load_scenario("open_sky");
  drive.scenario.gnss.rate_hz = c.rate_hz;
  drive.scenario.gnss.latency_s = c.latency_s;
  simulator::StreamOptions options;
  options.lidar = false;
  const auto reader = simulator::open_scenario(drive.scenario, 1, kDuration_s, options);
  while (auto entry = reader->next()) {
    drive.entries.push_back(std::move(*entry));
  }
  return drive;
}

double thread_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double percentile(std::vector<double> values, double share) {
  const double last = static_cast<double>(values.size() - 1);
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * last);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

struct Times {
  double busy_ms{0.0};
  double longest_fix_ms{0.0};
  std::vector<double> imu_to_odometry_ms;
};

void run_once(const Drive& drive, const std::string& name, Times& times) {
  gps_odometry::Config config;
  config.filter = name;
  gps_odometry::GpsOdometry filter(config, drive.scenario.robot);
  filter.on_datum(drive.scenario.datum);
  double free_ms = 0.0;  // when the thread has done what came before, in the drive's time
  for (const recording::LogEntry& entry : drive.entries) {
    const double before_ms = thread_ms();
    const auto* fix = std::get_if<GnssFix>(&entry.measurement);
    const auto output = fix != nullptr ? filter.on_fix(*fix)
                                       : filter.on_imu(std::get<ImuSample>(entry.measurement));
    const double took_ms = thread_ms() - before_ms;
    const double arrival_ms = 1e3 * to_seconds(entry.receive_ns - drive.scenario.start_ns());
    free_ms = std::max(free_ms, arrival_ms) + took_ms;
    times.busy_ms += took_ms;
    if (fix != nullptr) {
      times.longest_fix_ms = std::max(times.longest_fix_ms, took_ms);
    } else if (output.odometry) {
      times.imu_to_odometry_ms.push_back(free_ms - arrival_ms);
    }
  }
}

void drive(benchmark::State& state, const std::string& name, const Case& c) {
  const Drive drive = drive_of(c);
  Times times;
  for ([[maybe_unused]] auto _ : state) {
    run_once(drive, name, times);
  }
  state.counters["core_percent"] =
      100.0 * times.busy_ms / (1e3 * kDuration_s * static_cast<double>(state.iterations()));
  state.counters["p50_ms"] = percentile(times.imu_to_odometry_ms, 0.5);
  state.counters["p99_ms"] = percentile(times.imu_to_odometry_ms, 0.99);
  state.counters["max_ms"] = percentile(times.imu_to_odometry_ms, 1.0);
  state.counters["fix_max_ms"] = times.longest_fix_ms;
}

// As receivers are; at twice the rate and later than they are; every fix as late as the rewind
// buffer of 1 s allows, so that all of it is done again ten times a second.
constexpr Case kUsual{5.0, 0.12};
constexpr Case kLate{10.0, 0.3};
constexpr Case kWorst{10.0, 0.97};

BENCHMARK_CAPTURE(drive, ekf15_5_Hz_120_ms_late, "ekf15", kUsual)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, eskf18_5_Hz_120_ms_late, "eskf18", kUsual)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, ekf15_10_Hz_300_ms_late, "ekf15", kLate)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, eskf18_10_Hz_300_ms_late, "eskf18", kLate)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, ekf15_10_Hz_970_ms_late, "ekf15", kWorst)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, eskf18_10_Hz_970_ms_late, "eskf18", kWorst)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace trigpoint

BENCHMARK_MAIN();
