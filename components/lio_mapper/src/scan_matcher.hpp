// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "iterated_update.hpp"
#include "local_map.hpp"
#include "workers.hpp"
#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace trigpoint::lio_mapper {

/// Residuals of one scan against the planes of a local map: r = n . (R p + t) + d, FAST-LIO2
/// eq. 12. Sums the normal equations directly while it goes through the points.
class ScanMatcher {
 public:
  /// All are referred to, not copied; points in base axes. The result does not depend on the number
  /// of workers.
  ScanMatcher(const PointCloud& points_base,
              const LocalMap& map,
              const Eigen::Vector3d& lidar_position_base_m,
              const MatchingConfig& config,
              Workers& workers);

  /// Looks up the planes again when the pose has moved since the last time by more than planes
  /// can forgive; else only residuals and weights are new.
  PoseInformation linearise(const Pose& T_odom_base);

  /// Share of the points that lie within `distance_m` of their plane at the last linearisation.
  double share_within(double distance_m) const;

 private:
  struct Residual {
    Eigen::Vector3d point_base_m;
    Eigen::Vector3d direction_base;  ///< of the beam
    double range_m;
    PlaneMatch plane;
    double residual_m;
  };

  bool must_match_again(const Pose& T_odom_base) const;
  void match(const Pose& T_odom_base);
  bool match_point(const PointXyzi& point,
                   const Eigen::Matrix3d& R,
                   const Eigen::Vector3d& p,
                   Residual& residual) const;
  double variance_m2(const Residual& residual, double cos_incidence) const;
  PoseInformation sum_of(std::size_t block, const Pose& T_odom_base);

  const PointCloud& points_base_;
  const LocalMap& map_;
  Eigen::Vector3d lidar_position_base_m_;
  const MatchingConfig& config_;
  Workers& workers_;
  bool matched_{false};
  Pose T_odom_base_matched_;
  std::vector<Residual> residuals_;
  std::vector<Residual> slots_;  ///< one a point, while matching
  std::vector<std::uint8_t> has_match_;
  std::vector<PoseInformation> sums_;  ///< of blocks
};

}  // namespace trigpoint::lio_mapper
