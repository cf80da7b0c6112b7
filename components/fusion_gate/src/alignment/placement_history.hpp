// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include <deque>
#include <optional>

namespace trigpoint::fusion_gate {

/// T_map_odom of the last minute, to go back to when GPS is found to have lied for a while.
class PlacementHistory {
 public:
  explicit PlacementHistory(const Config& config) : config_(config) {}

  /// `distance_m` driven so far.
  void add(const LioStatus& lio, double distance_m);

  void clear() { placements_.clear(); }

  /// An alignment that puts the robot (base_link at `here_odom_m`) where T_map_odom of `stamp_ns`
  /// puts it; with `height_only` east, north and yaw stay as they are. The covariance is that of
  /// then, grown by LIO's drift since. None when nothing is known of that time.
  std::optional<Alignment> as_of(Nanoseconds stamp_ns,
                                 const LioStatus& now,
                                 const Eigen::Vector3d& here_odom_m,
                                 double distance_m,
                                 bool height_only) const;

 private:
  struct Placement {
    Nanoseconds stamp_ns;
    YawPose T_map_odom;
    Matrix6d covariance;
    double distance_m;
  };

  Config config_;
  std::deque<Placement> placements_;
};

/// An alignment with `T`'s yaw that puts `here_odom_m` at `here_map_m`: the mapper, which knows
/// odom's tilt, keeps the place of the robot. `yaw_variance_rad2` and `here_covariance_m2` are
/// taken as independent.
Alignment alignment_at(std::uint32_t odom_epoch,
                       double yaw_rad,
                       double yaw_variance_rad2,
                       const Eigen::Vector3d& here_odom_m,
                       const Eigen::Vector3d& here_map_m,
                       const Eigen::Matrix3d& here_covariance_m2);

/// An alignment that puts the robot (base_link at `here_odom_m`) by `aside_map_m` east and north of
/// where T_map_odom puts it, with their covariance; yaw and height stay as they are.
Alignment moved_aside(const LioStatus& now,
                      const Eigen::Vector3d& here_odom_m,
                      const Eigen::Vector2d& aside_map_m,
                      const Eigen::Matrix2d& covariance_m2);

}  // namespace trigpoint::fusion_gate
