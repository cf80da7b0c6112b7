// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Processes that failed in the middle of a drive and were started again by their supervisor, and
// what the mapper missed meanwhile.
#pragma once

#include "missed_scans.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

struct SessionData;

/// A line of restarts.csv, which trigpoint_supervise writes.
struct Restart {
  std::int64_t unix_s{0};
  std::string program;
  bool restarted{false};  ///< else it was given up
  double lived_s{0.0};
  std::string what;
};

/// Throws std::runtime_error with file and line.
std::vector<Restart> read_restarts(const std::string& file);

/// From "##" on, with the scans that were missed; empty when nothing failed and none was missed.
std::string print_restarts(const SessionData& data, const std::vector<MissedScans>& missed);

}  // namespace trigpoint::evaluation
