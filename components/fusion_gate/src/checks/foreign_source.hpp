// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/fusion_gate/config.hpp"

#include "alignment/alignment_window.hpp"
#include "alignment/pose_buffer.hpp"
#include "checks/accepted_fix.hpp"

#include <deque>
#include <optional>
#include <vector>

namespace trigpoint::fusion_gate {

/// A GPS filter that publishes plain Odometry and no GpsStatus: its frame may start at its own
/// first fix, be turned, and have a grid's scale (UTM). Yaw, offset and scale are estimated against
/// the raw fixes in map, and each raw fix then yields one accepted fix: the filter's antenna at
/// that stamp, in map.
class ForeignSource {
 public:
  ForeignSource(const Config& config, const Eigen::Vector3d& antenna_position_base_m);

  /// Both return the fixes that became ready, in the order of their stamps.
  std::vector<AcceptedFix> on_odometry(const Odometry& odometry);
  /// `fix` is the raw one, projected into map.
  std::vector<AcceptedFix> on_fix(const AcceptedFix& fix);

  /// The odometry in map; nullopt while the frame is not known well enough.
  std::optional<Odometry> in_map(const Odometry& odometry) const;

  void forget_alignment();

 private:
  std::vector<AcceptedFix> match();
  Odometry from_own_origin(const Odometry& odometry) const;
  Odometry brought_into_map(const Odometry& from_own_origin) const;
  std::optional<AcceptedFix> add_pair(const AcceptedFix& fix, const PoseBuffer::Sample& at_fix);

  Eigen::Vector3d lever_arm_base_m_;
  /// The first position that was heard: raw UTM coordinates would be thousands of kilometres away
  /// from their own origin.
  std::optional<Eigen::Vector3d> origin_m_;
  PoseBuffer poses_;
  AlignmentWindow window_;
  std::deque<AcceptedFix> pending_;
};

}  // namespace trigpoint::fusion_gate
