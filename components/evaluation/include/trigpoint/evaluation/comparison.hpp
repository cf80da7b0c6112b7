// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Files or sessions against files or sessions: the verb `trigpoint evaluate`.
#pragma once

#include "trigpoint/evaluation/evaluate.hpp"
#include "trigpoint/evaluation/map_quality.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

struct ComparisonInput {
  /// TUM file, KITTI file (known by its twelve columns), or session folder: all its trajectories.
  std::string estimate;
  /// The same; a session gives its truth, its withheld fixes and all its fixes, each for itself.
  /// Empty: the estimate's session.
  std::string reference;
  std::string lio_file;    ///< TUM in odom, to judge steps of a file against; a session has its own
  std::string fixes_file;  ///< fixes.csv, for outages; a session has its own
  Nanoseconds largest_gap_ns{kDefaultGap_ns};
  bool may_be_empty{false};  ///< nothing to compare is told in the remarks and is no error
};

/// One estimate against one reference, with the pairs that the figures are of.
struct Compared {
  Evaluation evaluation;
  std::vector<PosePair> pairs;
  bool is_in_reference_frame{true};  ///< false of lio.tum: its error without alignment says nothing
};

/// All estimates against one reference.
struct ComparisonBlock {
  std::string reference_name;
  std::string remark;  ///< e.g. that it is circular; may be empty
  std::vector<Compared> compared;
};

struct Comparison {
  std::vector<ComparisonBlock> blocks;
  std::vector<std::string> remarks;  ///< what could not be compared, and why; a sentence each
  std::vector<std::string> damaged;  ///< files of a session that cannot be read, and why
  std::optional<MapQuality> map;     ///< filled in by who wants it (map_quality.hpp)
};

/// Throws std::runtime_error naming file, line and cause, and when nothing has a moment in common
/// with anything; ConfigError for a file without a reference.
Comparison compare(const ComparisonInput& input);

/// Markdown that also reads well in a terminal.
std::string print(const Comparison& comparison);

/// Every figure with all its digits; null for what is not known. Lengths in m, angles in deg,
/// stamps in integer ns.
std::string to_json(const Comparison& comparison);

/// Error over time without alignment and by yaw + translation, and the top view, for each
/// reference. Returns the PNG files. Throws std::runtime_error naming what failed.
std::vector<std::string> draw(const Comparison& comparison,
                              const std::string& folder,
                              const std::string& gnuplot = "gnuplot");

}  // namespace trigpoint::evaluation
