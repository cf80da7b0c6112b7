// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// report.md, report.html and the pictures of a session.
#pragma once

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// In the session folder, beside report.md.
inline constexpr const char* kReportPage = "report.html";

struct ReportOptions {
  bool pictures{true};
  std::string gnuplot{"gnuplot"};  ///< program
  /// Lever arm for scoring against fixes. Without: robot.antenna_position_base_m of the session's
  /// config.yaml, else zero, which the report then says.
  std::optional<Eigen::Vector3d> antenna_position_base_m;
  bool page{true};  ///< report.html
  /// Of what was done with the session before, one sentence each: they stand first among
  /// `failures`.
  std::vector<std::string> failures{};
};

struct ReportResult {
  std::string report_file;
  std::string page_file;              ///< report.html; empty when there is none
  std::string text;                   ///< summary and table for the terminal (Markdown)
  std::vector<std::string> pictures;  ///< PNG files written
  /// What the session lacks or what failed, one sentence each; they stand in report.md too.
  std::vector<std::string> problems;
  /// Why the run was no success although it could be reported on: messages not accounted for
  /// without an interruption by the user, no alignment, nothing in map. One sentence each.
  std::vector<std::string> failures;
  /// There was a trajectory to report on, every file in the session could be read, and every
  /// picture that was asked for is there. The exit code should follow this.
  bool complete{false};
};

/// Throws std::runtime_error when `folder` does not exist or holds no file of a session.
void check_is_session(const std::string& folder);

/// Reads the session, writes report.md, report.html (one page that loads nothing from elsewhere:
/// the same tables, plots, the map in 3-D), and the pictures trajectories.png, uncertainty.png and
/// scan_times.png with their gnuplot scripts and data in plots/. What is missing or damaged is told
/// in `problems` and the rest is still reported. Throws std::runtime_error only when the folder
/// does not exist, holds no file of a session, or report.md cannot be written.
ReportResult write_report(const std::string& session_folder, const ReportOptions& options = {});

}  // namespace trigpoint::evaluation
