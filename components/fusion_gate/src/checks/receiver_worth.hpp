// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a receiver's own fixes are worth along east and north, where they are coarser than it says.
#pragma once

#include "trigpoint/fusion_gate/config.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace trigpoint::fusion_gate {

/// Measured by the first alignment, and once more for each kind of solution that claims to be well
/// better: by its own fixes against LIO's way over the alignment's least baseline. Until then the
/// claim alone changes nothing. Variances are of one axis, m^2; a claim is the larger of both axes.
class ReceiverWorth {
 public:
  explicit ReceiverWorth(const Config& config) : config_(config) {}

  /// The receiver said `said_m2`; its fixes lay about the first alignment by `measured_m2`.
  void on_alignment(double said_m2, double measured_m2);

  /// What a fix that says `said_m2` does not count as less than; 0: as it says.
  double least_m2(double said_m2) const;

  /// A fix along whose way LIO is not blind: the antenna as the receiver has it in map, and by LIO
  /// in odom, horizontally. `yaw_rad` is T_map_odom's; its position has no part in it, because rows
  /// of these fixes move it.
  void add(double said_m2,
           const Eigen::Vector2d& gps_map_m,
           const Eigen::Vector2d& lio_odom_m,
           double yaw_rad);

  /// LIO is blind, began anew or jumped, or map did: the way so far says nothing.
  void forget_way() { way_.clear(); }

 private:
  /// Kinds of solution, the coarsest first.
  struct Kind {
    double said_m2;
    double measured_m2;
  };

  struct Seen {
    double said_m2;
    Eigen::Vector2d gps_map_m;
    Eigen::Vector2d lio_odom_m;
  };

  std::size_t kind_of(double said_m2) const;
  double measured_on_the_way_m2(double yaw_rad) const;

  Config config_;
  std::vector<Kind> kinds_;
  std::vector<Seen> way_;
};

}  // namespace trigpoint::fusion_gate
