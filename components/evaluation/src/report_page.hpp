// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// report.html: a session on one page that needs nothing but itself.
#pragma once

#include "trigpoint/evaluation/report.hpp"

#include "session_data.hpp"
#include "session_scores.hpp"

#include <string>
#include <vector>

namespace trigpoint::evaluation {

struct PageContent {
  std::vector<ScoreBlock> scores;
  /// The tables, as in report.md; each from its "## " on.
  std::vector<std::string> sections;
  std::vector<std::string> problems;
  std::vector<std::string> failures;
};

/// The page's text; `map` (may be empty) lies under the trajectories and is shown in 3-D.
std::string make_page(const SessionData& data, const PointCloud& map, const PageContent& content);

}  // namespace trigpoint::evaluation
