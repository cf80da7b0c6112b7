// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the GPS filters cost: 200 Hz IMU, 5 Hz fixes that come 120 ms late (rewind). Figures are
// printed, never asserted: bounds are 5 % of one core and p99 of 2 ms from IMU in to odometry out.
#include "trigpoint/gps_odometry/gps_odometry.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint {
namespace {

constexpr double kDuration_s = 120.0;

const std::vector<recording::LogEntry>& entries() {
  static const std::vector<recording::LogEntry> all = [] {
    simulator::StreamOptions options;
    options.lidar = false;
    const auto reader =
        simulator::open_scenario(simulator::load_scenario("open_sky"), 1, kDuration_s, options);
    std::vector<recording::LogEntry> list;
    while (auto entry = reader->next()) {
      list.push_back(std::move(*entry));
    }
    return list;
  }();
  return all;
}

double percentile_ms(std::vector<double>& sorted_ms, double share) {
  const double last = static_cast<double>(sorted_ms.size() - 1);
  return sorted_ms[static_cast<std::size_t>(share * last)];
}

void drive(benchmark::State& state, const std::string& name) {
  using Clock = std::chrono::steady_clock;
  gps_odometry::Config config;
  config.filter = name;
  const simulator::Scenario scenario = simulator::load_scenario("open_sky");
  std::vector<double> imu_ms;
  std::vector<double> fix_ms;
  for ([[maybe_unused]] auto _ : state) {
    gps_odometry::GpsOdometry filter(config, scenario.robot);
    filter.on_datum(scenario.datum);
    for (const recording::LogEntry& entry : entries()) {
      const auto before = Clock::now();
      const auto* imu = std::get_if<ImuSample>(&entry.measurement);
      if (imu != nullptr) {
        benchmark::DoNotOptimize(filter.on_imu(*imu));
      } else if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
        benchmark::DoNotOptimize(filter.on_fix(*fix));
      }
      (imu != nullptr ? imu_ms : fix_ms)
          .push_back(std::chrono::duration<double, std::milli>(Clock::now() - before).count());
    }
  }
  std::sort(imu_ms.begin(), imu_ms.end());
  std::sort(fix_ms.begin(), fix_ms.end());
  double busy_ms = 0.0;
  for (const auto* times : {&imu_ms, &fix_ms}) {
    for (const double time_ms : *times) {
      busy_ms += time_ms;
    }
  }
  state.counters["core_percent"] =
      100.0 * busy_ms / (1e3 * kDuration_s * static_cast<double>(state.iterations()));
  state.counters["imu_p50_ms"] = percentile_ms(imu_ms, 0.5);
  state.counters["imu_p99_ms"] = percentile_ms(imu_ms, 0.99);
  state.counters["imu_max_ms"] = imu_ms.back();
  state.counters["fix_p99_ms"] = percentile_ms(fix_ms, 0.99);
}

BENCHMARK_CAPTURE(drive, ekf15, "ekf15")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, eskf18, "eskf18")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace trigpoint

BENCHMARK_MAIN();
