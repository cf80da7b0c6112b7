// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "reproduction.hpp"

#include "trigpoint/evaluation/comparison.hpp"

#include "session_data.hpp"

#include <algorithm>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr const char* kWithheldFixes = "withheld fixes";
constexpr const char* kAllFixes = "all fixes";

std::optional<Evaluation> of_fused(const Comparison& comparison, const std::string& reference) {
  for (const ComparisonBlock& block : comparison.blocks) {
    for (const Compared& compared : block.compared) {
      if (block.reference_name == reference && compared.evaluation.estimate_name == file::kFused) {
        return compared.evaluation;
      }
    }
  }
  return std::nullopt;
}

Comparison compare_session(const std::string& session, std::vector<std::string>& problems) {
  ComparisonInput input;
  input.estimate = session;
  input.may_be_empty = true;
  try {
    return compare(input);
  } catch (const std::exception& error) {
    problems.push_back(std::string(error.what()) + ".");
    return {};
  }
}

ModeFigures score_mode(const ModeSessions& sessions, std::vector<std::string>& problems) {
  ModeFigures figures;
  figures.mode = sessions.mode;
  const Comparison fed = compare_session(sessions.fed, problems);
  figures.fixes_fed = of_fused(fed, kAllFixes);
  figures.truth = of_fused(fed, file::kTruth);
  if (!figures.fixes_fed && !figures.truth) {
    problems.push_back("Mode " + sessions.mode + ": nothing was published in map, so there is " +
                       "nothing to score (" + sessions.fed + ").");
  }
  if (!sessions.withheld.empty()) {
    const Comparison withheld = compare_session(sessions.withheld, problems);
    figures.fixes_withheld = of_fused(withheld, kWithheldFixes);
    figures.truth_withheld = of_fused(withheld, file::kTruth);
    if (!figures.fixes_withheld) {
      problems.push_back("Mode " + sessions.mode + ": no withheld fix to score against (" +
                         sessions.withheld + ").");
    }
  }
  return figures;
}

}  // namespace

const std::vector<PaperRow>& paper_table() {
  static const std::vector<PaperRow> rows{{"Small Campus", 0.59, 0.62, 0.18},
                                          {"Park", 0.54, 0.94, 0.12}};
  return rows;
}

std::string paper_name_of(const std::string& mode) {
  return mode == "lio"       ? "FAST-LIO"
         : mode == "fusion"  ? "LIO-FUSION"
         : mode == "literal" ? "LIO-FUSION-UNCERTAINTY"
                             : "";
}

const Score& score_of(const Evaluation& evaluation, AlignmentKind kind) {
  const auto found = std::find_if(evaluation.scores.begin(),
                                  evaluation.scores.end(),
                                  [&](const Score& score) { return score.alignment == kind; });
  return found == evaluation.scores.end() ? evaluation.scores.front() : *found;
}

double rmse_of(const std::optional<Evaluation>& evaluation, AlignmentKind kind, bool horizontal) {
  if (!evaluation) {
    return kNaN;
  }
  const AbsoluteError& error = score_of(*evaluation, kind).error;
  return horizontal ? error.horizontal_m.rmse : error.position_m.rmse;
}

DriveFigures score(const ReproducedDrive& drive) {
  DriveFigures figures;
  figures.drive = drive;
  for (const ModeSessions& sessions : drive.modes) {
    figures.modes.push_back(score_mode(sessions, figures.problems));
  }
  if (!drive.modes.empty()) {
    // The same in every mode: no mode tells the GPS filter anything.
    figures.dropouts = load_session(drive.modes.front().fed, {}).outages();
  }
  return figures;
}

std::vector<std::string> failures_of(const Reproduction& result) {
  std::vector<std::string> failures;
  for (const DriveFigures& drive : result.drives) {
    for (const std::string& problem : drive.problems) {
      failures.push_back(drive.drive.name + ": " + problem);
    }
  }
  for (const std::string& missing : result.missing) {
    failures.push_back(missing + ": not done.");
  }
  return failures;
}

}  // namespace trigpoint::evaluation
