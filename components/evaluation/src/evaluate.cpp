// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/evaluate.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

constexpr std::array<AlignmentKind, 3> kAlignments{AlignmentKind::kNone,
                                                   AlignmentKind::kYawTranslation,
                                                   AlignmentKind::kSe3};
constexpr std::array<double, 3> kLengths_m{10.0, 50.0, 100.0};

Score score_of(const std::vector<PosePair>& pairs, AlignmentKind kind) {
  Score score;
  score.alignment = kind;
  score.T_reference_estimate = align(pairs, kind);
  score.error = score.T_reference_estimate
                    ? absolute_error(place_estimates(*score.T_reference_estimate, pairs))
                    : absolute_error({});
  return score;
}

/// Positions alone do not say how the estimate was turned: it is aligned before segments of it are
/// compared.
RelativeError relative_of(const std::vector<PosePair>& pairs,
                          ReferenceKind kind,
                          const std::optional<Pose>& T_reference_estimate,
                          double length_m,
                          const Breaks& breaks) {
  if (kind == ReferenceKind::kPoses) {
    return relative_error(pairs, length_m, breaks);
  }
  return relative_position_error(
      place_estimates(T_reference_estimate.value_or(Pose{}), pairs), length_m, breaks);
}

std::vector<PosePair> outside(const std::vector<PosePair>& pairs,
                              const std::vector<Window>& outages) {
  std::vector<PosePair> good;
  std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(good), [&](const PosePair& pair) {
    return !is_inside(outages, pair.stamp_ns);
  });
  return good;
}

std::string span_of(const Trajectory& trajectory) {
  return trajectory.empty() ? "no poses"
                            : exporter::stamp_text(trajectory.front().stamp_ns) + " to " +
                                  exporter::stamp_text(trajectory.back().stamp_ns) + " s";
}

}  // namespace

Evaluation evaluate_pairs(const Association& association,
                          ReferenceKind kind,
                          const EvaluationOptions& options) {
  const auto& pairs = association.pairs;
  Evaluation result;
  result.reference_kind = kind;
  result.pairs = pairs.size();
  result.coverage = association.coverage;
  for (std::size_t i = 0; i < kAlignments.size(); ++i) {
    result.scores[i] = score_of(pairs, kAlignments[i]);
  }
  const auto& T_reference_estimate = result.scores[1].T_reference_estimate;
  for (const double length_m : kLengths_m) {
    result.relative.push_back(
        relative_of(pairs, kind, T_reference_estimate, length_m, options.breaks));
  }
  if (kind == ReferenceKind::kPoses) {
    result.end_to_end = end_to_end(pairs, options.breaks);
  }
  if (!options.outages.empty()) {
    result.good = absolute_error(outside(pairs, options.outages));
    result.outages = outage_errors(pairs, options.outages);
  }
  return result;
}

Evaluation evaluate(const Trajectory& estimate,
                    const Trajectory& reference,
                    const EvaluationOptions& options) {
  auto result = evaluate_pairs(
      associate(estimate, reference, options.largest_gap_ns), ReferenceKind::kPoses, options);
  result.step = options.lio != nullptr ? largest_step(estimate, *options.lio, options.breaks)
                                       : largest_step(estimate, options.breaks);
  return result;
}

Evaluation evaluate_files(const std::string& estimate_file,
                          const std::string& reference_file,
                          const EvaluationOptions& options) {
  const auto estimate = exporter::read_trajectory(estimate_file);
  const auto reference = exporter::read_trajectory(reference_file);
  auto result = evaluate(estimate, reference, options);
  if (result.pairs == 0) {
    throw std::runtime_error(estimate_file + " (" + span_of(estimate) + ") and " + reference_file +
                             " (" + span_of(reference) + ") have no moment in common");
  }
  result.estimate_name = estimate_file;
  result.reference_name = reference_file;
  return result;
}

}  // namespace trigpoint::evaluation
