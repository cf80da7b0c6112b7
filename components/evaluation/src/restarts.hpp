// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Processes that failed in the middle of a drive and were started again by their supervisor, and
// what the mapper missed meanwhile.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/export/session.hpp"

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

struct MissedScans {
  Nanoseconds after_ns{0};   ///< the scan before the gap
  Nanoseconds before_ns{0};  ///< the scan after it
  std::uint64_t scans{0};
};

/// Gaps between processed scans, by their usual interval.
std::vector<MissedScans> find_missed_scans(const std::vector<exporter::LoggedScan>& scans);

/// From "##" on; empty when nothing failed.
std::string print_restarts(const SessionData& data);

}  // namespace trigpoint::evaluation
