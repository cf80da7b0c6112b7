// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/trajectory_error.hpp"

#include <algorithm>

namespace trigpoint::evaluation {

namespace {

auto first_not_before(const Trajectory& trajectory, Nanoseconds stamp_ns) {
  return std::lower_bound(
      trajectory.begin(), trajectory.end(), stamp_ns, [](const StampedPose& pose, Nanoseconds t) {
        return pose.stamp_ns < t;
      });
}

bool has_pose_near(const Trajectory& trajectory, Nanoseconds stamp_ns, Nanoseconds gap_ns) {
  const auto near = first_not_before(trajectory, stamp_ns - gap_ns);
  return near != trajectory.end() && near->stamp_ns <= stamp_ns + gap_ns;
}

Coverage coverage_of(const Trajectory& estimate, const Trajectory& reference, Nanoseconds gap_ns) {
  if (estimate.empty() || reference.empty()) {
    return {};
  }
  std::size_t covered = 0;
  std::size_t covered_since_first = 0;
  std::size_t since_first = 0;
  for (const auto& pose : reference) {
    const bool is_covered = has_pose_near(estimate, pose.stamp_ns, gap_ns);
    const bool is_since_first = pose.stamp_ns >= estimate.front().stamp_ns;
    covered += is_covered ? 1 : 0;
    since_first += is_since_first ? 1 : 0;
    covered_since_first += is_covered && is_since_first ? 1 : 0;
  }
  return {since_first == 0
              ? 0.0
              : static_cast<double>(covered_since_first) / static_cast<double>(since_first),
          static_cast<double>(covered) / static_cast<double>(reference.size())};
}

}  // namespace

std::optional<Pose> pose_at(const Trajectory& trajectory,
                            Nanoseconds stamp_ns,
                            Nanoseconds largest_gap_ns) {
  const auto after = first_not_before(trajectory, stamp_ns);
  if (after == trajectory.end()) {
    return std::nullopt;
  }
  if (after->stamp_ns == stamp_ns) {
    return after->pose;
  }
  if (after == trajectory.begin()) {
    return std::nullopt;
  }
  const auto before = std::prev(after);
  const Nanoseconds interval_ns = after->stamp_ns - before->stamp_ns;
  if (interval_ns > 2 * largest_gap_ns) {
    return std::nullopt;
  }
  const double fraction = to_seconds(stamp_ns - before->stamp_ns) / to_seconds(interval_ns);
  return interpolate(before->pose, after->pose, fraction);
}

Association associate(const Trajectory& estimate,
                      const Trajectory& reference,
                      Nanoseconds largest_gap_ns) {
  Association result;
  for (const auto& [stamp_ns, pose] : estimate) {
    if (const auto truth = pose_at(reference, stamp_ns, largest_gap_ns)) {
      result.pairs.push_back({stamp_ns, pose, *truth});
    }
  }
  result.coverage = coverage_of(estimate, reference, largest_gap_ns);
  return result;
}

}  // namespace trigpoint::evaluation
