// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One estimate against one reference, everything that can be said about it: the verb
// `trigpoint evaluate`.
#pragma once

#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// What a reference gives: truth with attitude, or antenna positions only (fixes).
enum class ReferenceKind { kPoses, kPositions };

struct Score {
  AlignmentKind alignment{AlignmentKind::kNone};
  std::optional<Pose> T_reference_estimate;  ///< nullopt: the positions do not determine it
  AbsoluteError error;                       ///< NaN without an alignment
};

struct Evaluation {
  std::string estimate_name;   ///< file
  std::string reference_name;  ///< file or e.g. "withheld fixes"
  ReferenceKind reference_kind{ReferenceKind::kPoses};
  std::size_t pairs{0};
  Coverage coverage;
  std::array<Score, 3> scores;          ///< none, yaw + translation, SE(3)
  std::vector<RelativeError> relative;  ///< over 10, 50 and 100 m
  EndToEnd end_to_end;
  std::optional<Step> step;           ///< when a continuous trajectory is given
  std::optional<AbsoluteError> good;  ///< without alignment, outside the outages
  std::vector<OutageError> outages;   ///< without alignment
};

struct EvaluationOptions {
  Nanoseconds largest_gap_ns{kDefaultGap_ns};
  std::vector<Window> outages;     ///< none: the whole is `good` and is not told apart
  const Trajectory* lio{nullptr};  ///< to judge steps against; not owned
  Breaks breaks{};                 ///< over which nothing was driven
};

/// Scores `pairs` (already associated). Without pairs every number is NaN.
Evaluation evaluate_pairs(const Association& association,
                          ReferenceKind kind,
                          const EvaluationOptions& options = {});

Evaluation evaluate(const Trajectory& estimate,
                    const Trajectory& reference,
                    const EvaluationOptions& options = {});

/// Reads both files (TUM). Throws std::runtime_error naming file, line and cause, and when the two
/// have no moment in common (naming both spans).
Evaluation evaluate_files(const std::string& estimate_file,
                          const std::string& reference_file,
                          const EvaluationOptions& options = {});

/// Markdown that also reads well in a terminal: names files, alignment, axes and coverage.
std::string print(const Evaluation& evaluation);

}  // namespace trigpoint::evaluation
