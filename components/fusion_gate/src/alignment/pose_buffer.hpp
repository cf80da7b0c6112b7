// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"

#include <deque>
#include <optional>

namespace trigpoint::fusion_gate {

/// The last seconds of a stream of poses, to be read at a fix's stamp.
class PoseBuffer {
 public:
  struct Sample {
    Nanoseconds stamp_ns{0};
    Pose T_frame_child;
    PoseCovariance covariance{PoseCovariance::Identity() * kUnknownVariance};
    double distance_m{0.0};  ///< driven since the buffer began
  };

  enum class Coverage { kCovered, kNotYet, kMissing };

  struct Answer {
    Coverage coverage{Coverage::kMissing};
    Sample sample;  ///< holds when covered; the covariance is the later neighbour's
  };

  PoseBuffer(Nanoseconds length_ns, Nanoseconds max_gap_ns)
      : length_ns_(length_ns), max_gap_ns_(max_gap_ns) {}

  /// False when the stamp does not advance or the pose is not finite: it is not kept.
  bool add(Nanoseconds stamp_ns, const Pose& pose, const PoseCovariance& covariance);

  /// Interpolated. kNotYet: newer than the newest pose; kMissing: older than the oldest, or in a
  /// gap.
  Answer at(Nanoseconds stamp_ns) const;

  std::optional<Nanoseconds> newest_ns() const;

  double distance_m() const { return distance_m_; }

  void forget_before(Nanoseconds stamp_ns);

 private:
  void advance_distance(const Eigen::Vector3d& position_m);

  Nanoseconds length_ns_;
  Nanoseconds max_gap_ns_;
  std::deque<Sample> samples_;
  std::optional<Eigen::Vector3d> distance_anchor_m_;
  double distance_m_{0.0};
};

}  // namespace trigpoint::fusion_gate
