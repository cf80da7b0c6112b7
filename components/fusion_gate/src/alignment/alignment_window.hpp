// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "alignment/yaw_alignment.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

/// The pairs of the newest stretch, and the alignment that follows from them.
class AlignmentWindow {
 public:
  explicit AlignmentWindow(const AlignmentConfig& config, double scale_sigma = 0.0)
      : config_(config), scale_sigma_(scale_sigma) {}

  /// Adds and solves. False when the pair says nothing new (too near to the last one, too soon, or
  /// not newer than it).
  bool add(const AlignmentPair& pair);

  /// LIO has come `moved_m` farther, with the variances of its place in its local map, axes of
  /// odom: where scans do not hold it, the pairs so far and those to come may lie that far apart.
  void on_lio(const Eigen::Vector3d& variance_odom_m2, double moved_m);

  void clear();

  /// What a measured heading says, from the next pair on. It is left out of a solution whose pairs
  /// alone contradict it.
  void set_heading(const std::optional<YawPrior>& heading) { heading_ = heading; }

  /// Of the whole window; when that is refused for its residuals, of the newest part that is not.
  const std::optional<AlignmentSolution>& solution() const { return solution_; }

  /// Why it must not be used yet; nullopt when it may. A sentence also before the first pair.
  const std::optional<std::string>& obstacle() const { return obstacle_; }

  bool admitted() const { return solution_ && !obstacle_; }

 private:
  bool is_redundant(const AlignmentPair& pair) const;
  void bound();
  void solve();
  std::optional<AlignmentSolution> solve(const std::vector<AlignmentPair>& pairs) const;

  AlignmentConfig config_;
  double scale_sigma_;
  Eigen::Vector3d lio_m2_{Eigen::Vector3d::Zero()};  ///< newest variance of LIO's place
  std::vector<AlignmentPair> pairs_;
  double spacing_factor_{1.0};
  std::optional<YawPrior> heading_;
  std::optional<AlignmentSolution> solution_;
  std::optional<std::string> obstacle_{"no matched fix yet"};
};

}  // namespace trigpoint::fusion_gate
