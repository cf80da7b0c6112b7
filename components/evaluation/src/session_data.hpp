// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/evaluation/report.hpp"
#include "trigpoint/export/session.hpp"

#include "missed_scans.hpp"
#include "restarts.hpp"
#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

struct ProgramCounts {
  std::string program;
  std::vector<NamedCount> counts;
};

/// Everything that a session folder holds; what is missing is empty, what is damaged is a problem.
struct SessionData {
  std::string folder;
  std::vector<std::string> problems;
  std::vector<std::string> damaged;  ///< those of them that are of what cannot be read in a file
  std::optional<exporter::RunInfo> run;  ///< the newest one
  std::optional<Datum> datum;
  std::optional<exporter::AlignmentRecord> alignment;
  Trajectory fused;
  Trajectory fused_smoothed;
  Trajectory lio;
  Trajectory gps;
  Trajectory truth;
  /// Not empty: truth.tum is there and must not be scored against, and why.
  std::string truth_refused;
  std::vector<exporter::LoggedFix> fixes;
  std::vector<FusionStatus> gate;
  std::vector<GpsStatus> gps_status;
  std::vector<exporter::LoggedScan> scans;
  bool has_scan_log{false};  ///< a mapper had a part in it, if only for a moment
  std::vector<exporter::LoggedSweep> sweeps;
  std::vector<ProgramCounts> counts;
  std::vector<Restart> restarts;
  std::int64_t datum_fixes{10};  ///< that an election takes, of the session's configuration
  Eigen::Vector3d antenna_position_base_m{Eigen::Vector3d::Zero()};

  /// Stamps of the fixes that took part: accepted by the GPS filter, else used by the gate, else
  /// fed at all. In order of time.
  std::vector<Nanoseconds> accepted_fixes_ns() const;

  /// Everything that was run, oldest first; those before the newest when a session was resumed.
  std::vector<exporter::RunInfo> runs() const;

  /// When the runs after the first one began, as far as that is known.
  Breaks run_begins() const;

  /// And the first scans of odom epochs after the first one.
  Breaks odom_begins() const;

  /// Gaps between accepted fixes of one run: above 2 s, and above 2.5 times the usual interval.
  std::vector<Window> outages() const;

  /// First and last stamp of anything; zero without anything.
  Window span() const;

  /// Of that, without what is between two runs.
  double driven_s() const;

  bool interrupted() const { return run && run->interrupted; }

  /// Fixes that the filters were given.
  std::size_t fixes_fed() const;

  std::string path(const std::string& name) const { return exporter::path_in(folder, name); }
};

SessionData load_session(const std::string& folder, const ReportOptions& options);

}  // namespace trigpoint::evaluation
