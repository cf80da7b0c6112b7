// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Faults asked directly, without a drive: many seeds and long times cost nothing.
#pragma once

#include "fault_schedule.hpp"
#include "scenarios.hpp"

#include <cmath>
#include <string>

namespace trigpoint::simulator {

inline constexpr double kPeriod_s = 0.2;  ///< of the fixes of `fix_at`

/// `settings` is the inside of one fault in YAML: "type: gps_bias, ramp_s: 2.0".
inline Scenario scenario_with_fault(const std::string& settings) {
  return small_scenario("faults:\n  - {" + settings + "}\n");
}

/// A fixed solution at `t_s` after the start of `scenario`, after its faults.
inline GnssEpoch fix_at(const Scenario& scenario, double t_s, std::uint64_t seed = 1) {
  GnssEpoch epoch;
  epoch.stamp_ns = scenario.start_ns() + from_seconds(t_s);
  epoch.period_s = kPeriod_s;
  epoch.gnss_class = "fixed";
  FaultSchedule(scenario.faults, scenario.start_ns(), seed).apply(epoch);
  return epoch;
}

inline ImuEpoch imu_at(const Scenario& scenario,
                       double t_s,
                       std::uint64_t seed = 1,
                       const ImuSample& sample = {}) {
  ImuEpoch epoch{sample};
  epoch.sample.stamp_ns = scenario.start_ns() + from_seconds(t_s);
  FaultSchedule(scenario.faults, scenario.start_ns(), seed).apply(epoch);
  return epoch;
}

/// Five standard deviations of a share measured over n independent draws.
inline double share_tolerance(double share, double n) {
  return 5.0 * std::sqrt(share * (1.0 - share) / n);
}

/// Five standard deviations of a mean of n squares of a standard normal.
inline double variance_tolerance(double n) {
  return 5.0 * std::sqrt(2.0 / n);
}

}  // namespace trigpoint::simulator
