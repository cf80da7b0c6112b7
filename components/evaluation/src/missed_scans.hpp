// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Which sweeps of a drive the mapper never answered: with neither odometry nor a refusal that has a
// reason.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/export/session.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

struct SessionData;

/// Sweeps in a row, on the clock of the estimates.
struct MissedScans {
  std::optional<Nanoseconds> after_ns;   ///< the scan before them; none: the beginning is missing
  std::optional<Nanoseconds> before_ns;  ///< the scan after them; none: the end is missing
  std::uint64_t scans{0};
  std::uint64_t refused{0};              ///< of the same stretch, not among `scans`: with a reason
  double silence_s{0.0};                 ///< without odometry, also where sweeps were refused
  std::optional<Nanoseconds> first_ns;   ///< arrival of the first sweep, when it is known
  std::optional<Nanoseconds> newest_ns;  ///< and of the last one
};

/// What a session says about the sweeps of its drives and the scans that came of them.
struct SweepsAndScans {
  const std::vector<exporter::LoggedSweep>& sweeps;
  const std::vector<exporter::LoggedScan>& scans;
  /// By the mapper, in the whole session; nullopt when it left no counts.
  std::optional<std::uint64_t> refused;
  Breaks run_begins;  ///< of drives after the first one
};

/// Of the sweeps that there were, those without a scan, less those refused with a reason. A scan
/// belongs to the sweep that arrived when most scans' sweeps arrive after their last point; one
/// that came late together with others counts as if it had come by their usual interval.
std::vector<MissedScans> find_unanswered_sweeps(const SweepsAndScans& there);

/// Gaps between processed scans, by their usual interval: when nobody knows which sweeps there
/// were. What is missing at the beginning and at the end does not show.
std::vector<MissedScans> find_missed_scans(const std::vector<exporter::LoggedScan>& scans,
                                           const Breaks& run_begins = {});

/// Of a session: by its sweeps if they are known, else by intervals where something was restarted.
std::vector<MissedScans> missed_scans_of(const SessionData& data);

/// "Scans missed: ..." with a list of them, of the longest when they are many.
std::string print_missed(const SessionData& data, const std::vector<MissedScans>& missed);

/// A sentence when at the end more sweeps were never answered than a restart takes, or a
/// considerable part of the drive; else empty. Also empty when a mapper that was started again
/// refused most sweeps since then: it came back, and what its predecessor had refused nobody knows.
std::string lost_end(const SessionData& data, const std::vector<MissedScans>& missed);

}  // namespace trigpoint::evaluation
