// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <optional>

namespace trigpoint::fusion_gate {

/// Hands a changed estimate over without a step: what it changed by stays in the published pose at
/// first and shrinks at limited rates. Rotations are about the robot.
class HandOver {
 public:
  HandOver(double rate_mps, double rate_radps) : rate_mps_(rate_mps), rate_radps_(rate_radps) {}

  /// What becomes of the changes: an estimate that is no better than what was published before is
  /// followed in its motion only.
  enum class Offset { kShrinks, kStays };

  /// The pose to publish for the estimate `raw`. `unchanged` is what the estimate would be at the
  /// same moment had nothing changed since the last call. What is left of the changes joins the
  /// covariance.
  Odometry follow(const Odometry& raw, const Pose& unchanged, Offset offset = Offset::kShrinks);

  /// Published less raw position.
  const Eigen::Vector3d& remaining_m() const { return offset_map_m_; }

 private:
  void shrink(double dt_s);

  double rate_mps_;
  double rate_radps_;
  Eigen::Vector3d offset_map_m_{Eigen::Vector3d::Zero()};
  Eigen::Quaterniond turn_{Eigen::Quaterniond::Identity()};  // published = turn_ * raw
  std::optional<Nanoseconds> last_ns_;
};

}  // namespace trigpoint::fusion_gate
