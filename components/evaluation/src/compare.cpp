// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/evaluation/comparison.hpp"
#include "trigpoint/export/trajectory_formats.hpp"

#include "fix_reference.hpp"
#include "session_data.hpp"
#include "table.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

namespace fs = std::filesystem;
namespace file = exporter::session_file;

struct Estimate {
  std::string name;
  Trajectory trajectory;
  bool is_in_map{true};
  std::optional<Trajectory> lio{};  ///< to judge its steps against
  Breaks breaks{};
  Breaks step_breaks{};
};

struct Reference {
  std::string name;
  std::string remark;
  ReferenceKind kind{ReferenceKind::kPoses};
  Trajectory trajectory;
  Eigen::Vector3d antenna_position_base_m{Eigen::Vector3d::Zero()};  ///< of positions
};

/// A trajectory file of either format. `is_by_index`: its stamps are made up.
struct PoseFile {
  Trajectory trajectory;
  bool is_by_index{false};
};

PoseFile read_poses(const std::string& path) {
  if (!fs::exists(path)) {
    throw std::runtime_error(path + ": no such file or session folder");
  }
  PoseFile result;
  if (exporter::format_of(path) == exporter::TrajectoryFormat::kKitti) {
    const std::string times = exporter::times_file_of(path);
    result.trajectory = exporter::read_kitti(path, times);
    result.is_by_index = times.empty();
  } else {
    result.trajectory = exporter::read_trajectory(path);
  }
  if (result.trajectory.empty()) {
    throw std::runtime_error(path + ": holds no pose");
  }
  return result;
}

/// KITTI files without times are compared pose by pose, with nothing else. Null: a session.
void check_indices(const ComparisonInput& input, const PoseFile* estimate, const PoseFile* other) {
  const auto is_by_index = [](const PoseFile* file) {
    return file != nullptr && file->is_by_index;
  };
  if (!is_by_index(estimate) && !is_by_index(other)) {
    return;
  }
  const bool are_alike = is_by_index(estimate) && is_by_index(other) &&
                         estimate->trajectory.size() == other->trajectory.size();
  if (are_alike) {
    return;
  }
  const auto told = [](const std::string& path, const PoseFile* file) {
    return path + (file == nullptr ? " (a session)"
                                   : " (" + std::to_string(file->trajectory.size()) + " poses)");
  };
  throw std::runtime_error(told(input.estimate, estimate) + " and " + told(input.reference, other) +
                           ": KITTI files hold no times; without a NAME_times.txt or times.txt "
                           "beside them only two of equal length can be compared");
}

/// What a session should have and cannot give is told.
std::vector<Estimate> estimates_of(const SessionData& session, Comparison& comparison) {
  std::vector<Estimate> estimates;
  const auto add = [&](const char* name, const Trajectory& trajectory, bool is_in_map) {
    if (trajectory.empty() && std::string(name) != file::kFusedSmoothed) {
      comparison.remarks.push_back(std::string("No error of ") + name +
                                   ": the session has no pose of it.");
    }
    if (!trajectory.empty()) {
      estimates.push_back({name,
                           trajectory,
                           is_in_map,
                           std::nullopt,
                           is_in_map ? session.run_begins() : session.odom_begins()});
    }
  };
  add(file::kFused, session.fused, true);
  if (!estimates.empty() && !session.lio.empty()) {
    estimates.back().lio = session.lio;
    estimates.back().step_breaks = session.odom_begins();
  }
  add(file::kFusedSmoothed, session.fused_smoothed, true);
  add(file::kLio, session.lio, false);
  add(file::kGps, session.gps, true);
  return estimates;
}

std::vector<Reference> references_of(const SessionData& session, Comparison& comparison) {
  std::vector<Reference> references;
  if (!session.truth.empty()) {
    references.push_back({file::kTruth, "", ReferenceKind::kPoses, session.truth});
  } else {
    comparison.remarks.push_back(session.truth_refused.empty()
                                     ? "No truth: " + session.folder + " holds no truth.tum."
                                     : session.truth_refused + ".");
  }
  if (!session.datum) {
    comparison.remarks.push_back("No error against fixes: the session has no datum.");
    return references;
  }
  const auto add = [&](const char* name, FixChoice choice, const char* remark) {
    Trajectory fixes = fix_positions(session.fixes, *session.datum, choice);
    if (fixes.empty()) {
      comparison.remarks.push_back(std::string("There are no ") + name + ".");
      return;
    }
    references.push_back({name,
                          remark,
                          ReferenceKind::kPositions,
                          std::move(fixes),
                          session.antenna_position_base_m});
  };
  add("withheld fixes",
      FixChoice::kWithheld,
      "Fixes that no filter was given. Their own error is part of the numbers.");
  add("all fixes",
      FixChoice::kAll,
      "Circular where the filters were given them: consistency with GPS, not accuracy.");
  return references;
}

std::vector<Window> outages_in(const std::string& fixes_file, Nanoseconds end_ns) {
  std::vector<Nanoseconds> stamps_ns;
  for (const exporter::LoggedFix& logged : exporter::read_fixes(fixes_file)) {
    if (!logged.withheld && logged.fix.status != FixStatus::kNoFix) {
      stamps_ns.push_back(logged.fix.stamp_ns);
    }
  }
  return find_outages(stamps_ns, end_ns);
}

Compared compare(const Estimate& estimate,
                 const Reference& reference,
                 const std::vector<Window>& outages,
                 Nanoseconds largest_gap_ns) {
  EvaluationOptions options;
  options.largest_gap_ns = largest_gap_ns;
  options.outages = outages;
  options.breaks = estimate.breaks;
  const Association association =
      reference.kind == ReferenceKind::kPoses
          ? associate(estimate.trajectory, reference.trajectory, largest_gap_ns)
          : associate_fixes(estimate.trajectory,
                            reference.trajectory,
                            reference.antenna_position_base_m,
                            largest_gap_ns);
  Compared compared;
  compared.evaluation = evaluate_pairs(association, reference.kind, options);
  compared.evaluation.estimate_name = estimate.name;
  compared.evaluation.reference_name = reference.name;
  compared.evaluation.step =
      estimate.lio ? largest_step(estimate.trajectory, *estimate.lio, estimate.step_breaks)
                   : largest_step(estimate.trajectory, estimate.breaks);
  compared.pairs = association.pairs;
  compared.is_in_reference_frame = estimate.is_in_map;
  return compared;
}

void note_damaged(const SessionData& session, Comparison& comparison) {
  comparison.damaged.insert(
      comparison.damaged.end(), session.damaged.begin(), session.damaged.end());
}

/// What is to be compared, read.
struct Sides {
  std::vector<Estimate> estimates;
  std::vector<Reference> references;
  std::vector<Window> outages;
};

Sides read_sides(const ComparisonInput& input, Comparison& comparison) {
  Sides sides;
  const bool estimate_is_session = fs::is_directory(input.estimate);
  const std::string reference = input.reference.empty() ? input.estimate : input.reference;
  const bool reference_is_session = fs::is_directory(reference);
  if (!estimate_is_session && input.reference.empty()) {
    throw ConfigError(input.estimate +
                      ": a file needs a reference to be compared with; a session folder brings its "
                      "own");
  }
  std::optional<PoseFile> estimate_file;
  if (estimate_is_session) {
    const SessionData session = load_session(input.estimate, {});
    sides.estimates = estimates_of(session, comparison);
    sides.outages = session.outages();
    note_damaged(session, comparison);
  } else {
    estimate_file = read_poses(input.estimate);
    sides.estimates.push_back({input.estimate, estimate_file->trajectory, true, std::nullopt});
    if (!input.lio_file.empty()) {
      sides.estimates.back().lio = exporter::read_trajectory(input.lio_file);
    }
  }
  std::optional<PoseFile> reference_file;
  if (!reference_is_session) {
    reference_file = read_poses(reference);
  }
  check_indices(input,
                estimate_file ? &*estimate_file : nullptr,
                reference_file ? &*reference_file : nullptr);
  if (reference_is_session) {
    const SessionData session = load_session(reference, {});
    sides.references = references_of(session, comparison);
    sides.outages = session.outages();
    if (reference != input.estimate) {
      note_damaged(session, comparison);
    }
  } else {
    sides.references.push_back({reference, "", ReferenceKind::kPoses, reference_file->trajectory});
  }
  if (!input.fixes_file.empty() && !sides.estimates.empty()) {
    const Trajectory& first = sides.estimates.front().trajectory;
    sides.outages = outages_in(input.fixes_file, first.back().stamp_ns);
  }
  return sides;
}

/// Everything of a block in one table.
std::string summary_of(const ComparisonBlock& block) {
  Table table({"file",
               "alignment",
               "rmse m",
               "median",
               "max",
               "rmse x (E)",
               "rmse y (N)",
               "rmse z (U)",
               "% over 100 m",
               "pairs",
               "coverage"});
  for (const Compared& compared : block.compared) {
    const Evaluation& evaluation = compared.evaluation;
    for (const Score& score : evaluation.scores) {
      const auto& axes = score.error.axes_m;
      table.add({evaluation.estimate_name,
                 name_of(score.alignment),
                 fixed(score.error.position_m.rmse, 3),
                 fixed(score.error.position_m.median, 3),
                 fixed(score.error.position_m.max, 3),
                 fixed(axes[0].rmse, 3),
                 fixed(axes[1].rmse, 3),
                 fixed(axes[2].rmse, 3),
                 fixed(evaluation.relative.back().translation_percent, 3),
                 std::to_string(evaluation.pairs),
                 share(evaluation.coverage.from_first)});
    }
  }
  return table.str() + "\n";
}

std::string compared_span_of(const Trajectory& trajectory) {
  return exporter::stamp_text(trajectory.front().stamp_ns) + " to " +
         exporter::stamp_text(trajectory.back().stamp_ns) + " s";
}

}  // namespace

Comparison compare(const ComparisonInput& input) {
  Comparison comparison;
  const Sides sides = read_sides(input, comparison);
  for (const Reference& reference : sides.references) {
    ComparisonBlock block{reference.name, reference.remark, {}};
    for (const Estimate& estimate : sides.estimates) {
      Compared compared = compare(estimate, reference, sides.outages, input.largest_gap_ns);
      if (compared.pairs.empty()) {
        comparison.remarks.push_back(estimate.name + " (" + compared_span_of(estimate.trajectory) +
                                     ") and " + reference.name + " (" +
                                     compared_span_of(reference.trajectory) +
                                     ") have no moment in common.");
        continue;
      }
      block.compared.push_back(std::move(compared));
    }
    if (!block.compared.empty()) {
      comparison.blocks.push_back(std::move(block));
    }
  }
  if (comparison.blocks.empty() && !input.may_be_empty) {
    std::string reasons;
    for (const auto* list : {&comparison.damaged, &comparison.remarks}) {
      for (const std::string& reason : *list) {
        reasons += (reasons.empty() ? "" : " ") + reason;
      }
    }
    throw std::runtime_error("there is nothing to compare: " + reasons);
  }
  return comparison;
}

std::string print(const Comparison& comparison) {
  std::string text;
  for (const ComparisonBlock& block : comparison.blocks) {
    text += "## Against " + block.reference_name + "\n\n";
    text += block.remark.empty() ? "" : block.remark + "\n\n";
    text += block.compared.size() > 1 ? summary_of(block) : "";
    for (const Compared& compared : block.compared) {
      text += print(compared.evaluation);
      if (!compared.is_in_reference_frame) {
        text +=
            "This trajectory lives in odom: without alignment its error only tells where odom "
            "began.\n";
      }
      text += "\n";
    }
  }
  for (const std::string& remark : comparison.remarks) {
    text += remark + "\n";
  }
  return comparison.map ? text + "\n" + print(*comparison.map) : text;
}

}  // namespace trigpoint::evaluation
