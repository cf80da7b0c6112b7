// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The parts of the contract, one file each; gps_filter_contract.hpp is their face.
#pragma once

#include "gps_filter_contract.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace trigpoint::cli {

struct FilterDrive {
  const recording::FilterRecord& record;
  const FilterScript& script;
  const simulator::Truth& truth;

  double since_start_s(Nanoseconds stamp_ns) const {
    return to_seconds(stamp_ns - script.start_ns);
  }

  bool in_outage(Nanoseconds stamp_ns, double after_s = 0.0) const {
    return stamp_ns > script.outage_from_ns + from_seconds(after_s) &&
           stamp_ns < script.outage_to_ns;
  }
};

using ContractChecks = std::vector<ContractCheck>;

/// Frames, stamps, numbers, covariances, rates, datum: what needs no truth.
void judge_form(const FilterDrive& drive, ContractChecks& checks);

/// Errors against sigmas.
void judge_honesty(const FilterDrive& drive, ContractChecks& checks);

/// Health and sigma through the outage.
void judge_outage(const FilterDrive& drive, ContractChecks& checks);

/// printf into a string.
std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// A variance below this is known; above it, it must be 1e6.
inline constexpr double kKnownBelow = 1e4;

/// The larger of the two horizontal ones.
inline double sigma_m(const Odometry& odometry) {
  return std::sqrt(std::max(odometry.pose_covariance(0, 0), odometry.pose_covariance(1, 1)));
}

}  // namespace trigpoint::cli
