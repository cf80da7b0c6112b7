// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/pose_buffer.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

namespace {

// Jitter of a robot at rest must not count as distance.
constexpr double kDistanceStep_m = 0.05;

}  // namespace

bool PoseBuffer::add(Nanoseconds stamp_ns, const Pose& pose, const PoseCovariance& covariance) {
  if (!pose.is_finite() || (!samples_.empty() && stamp_ns <= samples_.back().stamp_ns)) {
    return false;
  }
  advance_distance(pose.p);
  samples_.push_back({stamp_ns, pose, covariance, distance_m_});
  while (samples_.size() > 2 && samples_[1].stamp_ns < stamp_ns - length_ns_) {
    samples_.pop_front();
  }
  return true;
}

PoseBuffer::Answer PoseBuffer::at(Nanoseconds stamp_ns) const {
  if (samples_.empty() || stamp_ns > samples_.back().stamp_ns) {
    return {Coverage::kNotYet, {}};
  }
  const auto after = std::lower_bound(
      samples_.begin(), samples_.end(), stamp_ns, [](const Sample& sample, Nanoseconds wanted_ns) {
        return sample.stamp_ns < wanted_ns;
      });
  if (after->stamp_ns == stamp_ns) {
    return {Coverage::kCovered, *after};
  }
  if (after == samples_.begin()) {
    return {Coverage::kMissing, {}};
  }
  const Sample& before = *std::prev(after);
  const Nanoseconds gap_ns = after->stamp_ns - before.stamp_ns;
  if (gap_ns > max_gap_ns_) {
    return {Coverage::kMissing, {}};
  }
  const double fraction = to_seconds(stamp_ns - before.stamp_ns) / to_seconds(gap_ns);
  return {Coverage::kCovered,
          {stamp_ns,
           interpolate(before.T_frame_child, after->T_frame_child, fraction),
           after->covariance,
           before.distance_m + fraction * (after->distance_m - before.distance_m)}};
}

std::optional<Nanoseconds> PoseBuffer::newest_ns() const {
  return samples_.empty() ? std::nullopt : std::optional(samples_.back().stamp_ns);
}

void PoseBuffer::forget_before(Nanoseconds stamp_ns) {
  while (!samples_.empty() && samples_.front().stamp_ns < stamp_ns) {
    samples_.pop_front();
  }
  distance_anchor_m_.reset();
}

void PoseBuffer::advance_distance(const Eigen::Vector3d& position_m) {
  if (!distance_anchor_m_) {
    distance_anchor_m_ = position_m;
  }
  const double step_m = (position_m - *distance_anchor_m_).norm();
  if (step_m > kDistanceStep_m) {
    distance_m_ += step_m;
    distance_anchor_m_ = position_m;
  }
}

}  // namespace trigpoint::fusion_gate
