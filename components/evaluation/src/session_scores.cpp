// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "session_scores.hpp"

#include "fix_reference.hpp"
#include "table.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

struct Named {
  const char* name;
  const Trajectory& trajectory;
};

std::vector<Named> estimates_of(const SessionData& data) {
  std::vector<Named> estimates{{file::kFused, data.fused}};
  if (!data.fused_smoothed.empty()) {
    estimates.push_back({file::kFusedSmoothed, data.fused_smoothed});
  }
  estimates.push_back({file::kLio, data.lio});
  estimates.push_back({file::kGps, data.gps});
  return estimates;
}

/// odom begins anew with each epoch, map does not.
Breaks breaks_of(const SessionData& data, const std::string& estimate) {
  return estimate == file::kLio ? data.odom_begins() : data.run_begins();
}

/// Runs of a session in whose time truth.tum has no pose.
std::string print_runs_without_truth(const SessionData& data) {
  const std::vector<exporter::RunInfo> runs = data.runs();
  std::string text;
  for (std::size_t i = 0; runs.size() > 1 && !data.truth.empty() && i < runs.size(); ++i) {
    const bool is_last = i + 1 == runs.size();
    const auto is_of_run = [&](const exporter::StampedPose& pose) {
      return (i == 0 || !runs[i].begin_ns || pose.stamp_ns >= *runs[i].begin_ns) &&
             (is_last || !runs[i + 1].begin_ns || pose.stamp_ns < *runs[i + 1].begin_ns);
    };
    if (std::none_of(data.truth.begin(), data.truth.end(), is_of_run)) {
      text += "**" + std::string(file::kTruth) + " holds nothing of the run of `" + runs[i].log +
              "`: that part is not scored against it.**\n\n";
    }
  }
  return text;
}

ScoreBlock score_against_truth(const SessionData& data) {
  ScoreBlock block{file::kTruth, "", {}};
  EvaluationOptions options;
  options.outages = data.outages();
  for (const auto& [name, trajectory] : estimates_of(data)) {
    options.breaks = breaks_of(data, name);
    auto& result = block.evaluations.emplace_back(evaluate(trajectory, data.truth, options));
    result.estimate_name = name;
  }
  return block;
}

ScoreBlock score_against_fixes(const SessionData& data,
                               const Trajectory& fixes,
                               const std::string& name,
                               const std::string& remark) {
  ScoreBlock block{name, remark, {}};
  EvaluationOptions options;
  options.outages = data.outages();
  for (const auto& [estimate, trajectory] : estimates_of(data)) {
    options.breaks = breaks_of(data, estimate);
    const auto pairs = associate_fixes(trajectory, fixes, data.antenna_position_base_m);
    auto& result =
        block.evaluations.emplace_back(evaluate_pairs(pairs, ReferenceKind::kPositions, options));
    result.estimate_name = estimate;
  }
  return block;
}

std::string error_table(const ScoreBlock& block) {
  Table table({"file",
               "alignment",
               "rmse",
               "mean",
               "median",
               "max",
               "rmse x (E)",
               "rmse y (N)",
               "rmse z (U)",
               "pairs",
               "coverage",
               "of whole"});
  for (const auto& evaluation : block.evaluations) {
    for (const auto& score : evaluation.scores) {
      const auto& p = score.error.position_m;
      table.add({evaluation.estimate_name,
                 name_of(score.alignment),
                 fixed(p.rmse, 3),
                 fixed(p.mean, 3),
                 fixed(p.median, 3),
                 fixed(p.max, 3),
                 fixed(score.error.axes_m[0].rmse, 3),
                 fixed(score.error.axes_m[1].rmse, 3),
                 fixed(score.error.axes_m[2].rmse, 3),
                 std::to_string(evaluation.pairs),
                 share(evaluation.coverage.from_first),
                 share(evaluation.coverage.whole)});
    }
  }
  return table.str();
}

std::string relative_table(const ScoreBlock& block) {
  Table table({"file", "10 m", "50 m", "100 m", "deg/m over 50 m", "end to end"});
  for (const auto& evaluation : block.evaluations) {
    const auto percent = [&](std::size_t i) {
      const auto text = fixed(evaluation.relative.at(i).translation_percent, 2);
      return text == "-" ? text : text + " %";
    };
    const auto& end = evaluation.end_to_end;
    table.add({evaluation.estimate_name,
               percent(0),
               percent(1),
               percent(2),
               fixed(evaluation.relative.at(1).rotation_deg_per_m, 5),
               std::isfinite(end.error_m)
                   ? fixed(end.error_m, 2) + " m of " + fixed(end.distance_m, 0) + " m"
                   : "-"});
  }
  return table.str();
}

/// Only fused and gps live in map, so only they have an error without alignment.
std::string outage_table(const ScoreBlock& block) {
  Table table({"file", "part", "duration s", "rmse", "error at begin", "max", "error at end"});
  for (const auto& evaluation : block.evaluations) {
    if (evaluation.estimate_name == file::kLio || !evaluation.good) {
      continue;
    }
    const auto& good = evaluation.good->position_m;
    table.add({evaluation.estimate_name,
               "GPS good",
               "",
               fixed(good.rmse, 3),
               "",
               fixed(good.max, 3),
               ""});
    for (const auto& outage : evaluation.outages) {
      table.add({evaluation.estimate_name,
                 "outage from " + exporter::stamp_text(outage.window.begin_ns),
                 fixed(to_seconds(outage.window.end_ns - outage.window.begin_ns), 1),
                 "",
                 fixed(outage.begin_m, 3),
                 fixed(outage.max_m, 3),
                 fixed(outage.end_m, 3)});
    }
  }
  return table.is_empty() ? "No outage: accepted fixes came without a gap longer than 2 s.\n"
                          : table.str();
}

std::string print(const ScoreBlock& block) {
  const bool positions = !block.evaluations.empty() &&
                         block.evaluations.front().reference_kind == ReferenceKind::kPositions;
  std::string text =
      "### Against " + block.reference_name + "\n\n" + block.remark +
      "Position error in metres at " + (positions ? "the antenna" : "base_link") +
      ", axes of map. Coverage: share of the reference from the file's first pose, and of the "
      "whole reference. " +
      std::string(file::kLio) +
      " lives in odom, so its row without alignment only tells where odom began.\n\n";
  text += error_table(block);
  text += "\nRelative translation error of segments of a given length (mean), and of the whole";
  text += positions ? "; positions only, after alignment by yaw + translation:\n\n"
                    : "; needs no alignment:\n\n";
  text += relative_table(block);
  text += "\nWith GPS and in its outages (no alignment):\n\n" + outage_table(block);
  return text + "\n";
}

std::string print_step(const SessionData& data) {
  if (data.fused.size() < 2) {
    return "";
  }
  const auto step = data.lio.empty() ? largest_step(data.fused, data.run_begins())
                                     : largest_step(data.fused, data.lio, data.odom_begins());
  const std::size_t unjudged = data.fused.size() - 1 - step.intervals;
  return "Largest step of " + std::string(file::kFused) +
         (step.relative_to_lio ? " (its change minus that of lio.tum over the same interval): "
                               : " (plain change between consecutive poses): ") +
         fixed(step.distance_m, 3) + " m, " + fixed(step.rotation_deg, 2) + " deg at " +
         exporter::stamp_text(step.stamp_ns) + ", of " + std::to_string(step.intervals) +
         " intervals" +
         (unjudged == 0
              ? ""
              : "; " + std::to_string(unjudged) +
                    " more are not judged, since lio.tum has no pose near them" +
                    (data.odom_begins().empty() ? "" : " or odom or the run began anew")) +
         ".\n";
}

}  // namespace

std::vector<ScoreBlock> score_session(const SessionData& data) {
  std::vector<ScoreBlock> blocks;
  if (!data.truth.empty()) {
    blocks.push_back(score_against_truth(data));
  }
  if (!data.datum) {
    return blocks;
  }
  const auto withheld = fix_positions(data.fixes, *data.datum, FixChoice::kWithheld);
  if (!withheld.empty()) {
    blocks.push_back(score_against_fixes(data,
                                         withheld,
                                         "withheld fixes",
                                         "Fixes that no filter was given. Their own error is "
                                         "part of the numbers. "));
  }
  const auto all = fix_positions(data.fixes, *data.datum, FixChoice::kAll);
  if (blocks.empty() && !all.empty()) {
    blocks.push_back(score_against_fixes(
        data,
        all,
        "all fixes (circular)",
        "**There is neither truth nor a withheld fix: these are the fixes that the filters were "
        "given. The numbers tell consistency, not accuracy.** "));
  }
  return blocks;
}

std::string print_scores(const SessionData& data, const std::vector<ScoreBlock>& blocks) {
  std::string text;
  for (const auto& block : blocks) {
    text += print(block);
  }
  if (!data.truth_refused.empty()) {
    text = "**" + data.truth_refused +
           ".** A run with the same datum (gps_odometry.datum_*) can be " +
           "scored against it; the picture does not show it either.\n\n" + text;
  }
  if (blocks.empty()) {
    text +=
        "There is nothing to measure against: no truth.tum that could be used, and no fixes with a "
        "datum.\n\n";
  }
  return print_runs_without_truth(data) + text + print_step(data);
}

}  // namespace trigpoint::evaluation
