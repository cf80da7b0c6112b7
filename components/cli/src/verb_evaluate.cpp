// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/export/session.hpp"

#include "verbs.hpp"

#include <cstdio>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

namespace trigpoint::cli {

namespace {

using namespace evaluation;

struct EvaluateOptions {
  std::string estimate;
  std::string reference;
  std::string lio;
  std::string fixes;
};

void print_absolute(const std::string& name, const AbsoluteError& error) {
  std::printf("%-18s %8.3f %8.3f %8.3f %8.3f   %8.3f %8.3f %8.3f   %8.3f\n",
              name.c_str(),
              error.position_m.rmse,
              error.position_m.mean,
              error.position_m.median,
              error.position_m.max,
              error.axes_m[0].rmse,
              error.axes_m[1].rmse,
              error.axes_m[2].rmse,
              error.rotation_deg.rmse);
}

/// Returns the pairs aligned in yaw and translation, or as they are where that is not determined.
void print_alignments(const std::vector<PosePair>& pairs) {
  std::printf("%-18s %8s %8s %8s %8s   %8s %8s %8s   %8s\n",
              "alignment",
              "rmse m",
              "mean",
              "median",
              "max",
              "rmse x",
              "rmse y",
              "rmse z",
              "rot deg");
  for (const AlignmentKind kind :
       {AlignmentKind::kNone, AlignmentKind::kYawTranslation, AlignmentKind::kSe3}) {
    const std::optional<Pose> T = align(pairs, kind);
    if (T) {
      print_absolute(name_of(kind), absolute_error(place_estimates(*T, pairs)));
    } else {
      std::printf("%-18s not determined: too few poses, or all on one line\n",
                  name_of(kind).c_str());
    }
  }
}

void print_relative(const std::vector<PosePair>& pairs) {
  for (const double length_m : {10.0, 50.0, 100.0}) {
    const RelativeError error = relative_error(pairs, length_m);
    if (error.segments > 0) {
      std::printf("relative over %.0f m: %.3f %%, %.4f deg/m (%zu segments)\n",
                  length_m,
                  error.translation_percent,
                  error.rotation_deg_per_m,
                  error.segments);
    }
  }
  const EndToEnd end = end_to_end(pairs);
  std::printf("end to end: %.3f m after %.1f m (%.3f %%), %.3f deg\n",
              end.error_m,
              end.distance_m,
              end.percent,
              end.error_deg);
}

void print_step(const EvaluateOptions& options, const Trajectory& estimate) {
  const Step step = options.lio.empty()
                        ? largest_step(estimate)
                        : largest_step(estimate, exporter::read_trajectory(options.lio));
  std::printf("largest step: %.4f m, %.4f deg at %s (%s, %zu intervals)\n",
              step.distance_m,
              step.rotation_deg,
              exporter::stamp_text(step.stamp_ns).c_str(),
              step.relative_to_lio ? "beyond the change of odom" : "between consecutive poses",
              step.intervals);
}

void print_outages(const std::string& fixes_file, const std::vector<PosePair>& pairs) {
  std::vector<Nanoseconds> fixes_ns;
  for (const exporter::LoggedFix& logged : exporter::read_fixes(fixes_file)) {
    if (!logged.withheld && logged.fix.status != FixStatus::kNoFix) {
      fixes_ns.push_back(logged.fix.stamp_ns);
    }
  }
  const std::vector<Window> outages = find_outages(fixes_ns, pairs.back().stamp_ns);
  for (const OutageError& error : outage_errors(pairs, outages)) {
    std::printf(
        "outage of %.1f s: error %.3f m at its begin, %.3f m at most, %.3f m at its end (no "
        "alignment)\n",
        to_seconds(error.window.end_ns - error.window.begin_ns),
        error.begin_m,
        error.max_m,
        error.end_m);
  }
  if (outages.empty()) {
    std::printf("no outage longer than 2 s\n");
  }
}

/// Throws std::runtime_error for a file without a pose too.
Trajectory read_poses(const std::string& file) {
  Trajectory trajectory = exporter::read_trajectory(file);
  if (trajectory.empty()) {
    throw std::runtime_error(file + ": holds no pose");
  }
  return trajectory;
}

int run(const EvaluateOptions& options) {
  const Trajectory estimate = read_poses(options.estimate);
  const Trajectory reference = read_poses(options.reference);
  const Association association = associate(estimate, reference);
  if (association.pairs.empty()) {
    std::cerr << "trigpoint evaluate: no pose of " << options.estimate
              << " lies within the time of " << options.reference << "\n";
    return 1;
  }
  std::printf(
      "%s against %s\n%zu pairs; coverage %.1f %% from the estimate's first pose, %.1f %% of the "
      "whole reference\n\n",
      options.estimate.c_str(),
      options.reference.c_str(),
      association.pairs.size(),
      100.0 * association.coverage.from_first,
      100.0 * association.coverage.whole);
  print_alignments(association.pairs);
  std::printf("\n");
  print_relative(association.pairs);
  print_step(options, estimate);
  if (!options.fixes.empty()) {
    print_outages(options.fixes, association.pairs);
  }
  return 0;
}

}  // namespace

void add_evaluate(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("evaluate",
                                      "Errors of a trajectory against a reference: three "
                                      "alignments, per axis, coverage, steps, end to end");
  const auto options = std::make_shared<EvaluateOptions>();
  verb->add_option("ESTIMATE", options->estimate, "TUM file, e.g. SESSION/fused.tum")
      ->required()
      ->check(CLI::ExistingFile);
  verb->add_option("REFERENCE", options->reference, "TUM file, e.g. SESSION/truth.tum")
      ->required()
      ->check(CLI::ExistingFile);
  verb->add_option("--lio", options->lio, "TUM file in odom: steps are told beyond its own change")
      ->check(CLI::ExistingFile);
  verb->add_option("--fixes", options->fixes, "fixes.csv of the session: errors in GPS outages")
      ->check(CLI::ExistingFile);
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
