// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/evaluation/evaluate.hpp"

#include "session_data.hpp"

#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// Every trajectory of the session against one reference.
struct ScoreBlock {
  std::string reference_name;  ///< "truth.tum", "withheld fixes", "all fixes"
  std::string remark;          ///< e.g. that it is circular
  std::vector<Evaluation> evaluations;
};

/// Against truth when there is one, and against the withheld fixes when there are any; against all
/// fixes, labelled circular, when there is neither.
std::vector<ScoreBlock> score_session(const SessionData& data);

/// The error table with files, alignments, axes and coverage; and below it relative errors, the
/// part with GPS, the outages and the largest step.
std::string print_scores(const SessionData& data, const std::vector<ScoreBlock>& blocks);

}  // namespace trigpoint::evaluation
