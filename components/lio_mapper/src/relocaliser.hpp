// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where a scan lies in a map when its place is known to some metres and its heading to some tens of
// degrees only.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "local_map.hpp"
#include "workers.hpp"
#include <Eigen/Geometry>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// A scan whose roll and pitch are known.
struct LevelScan {
  const PointCloud& points_base;
  Eigen::Quaterniond q_level_base;  ///< roll and pitch alone: takes base axes to level ones
  Eigen::Vector3d lidar_position_base_m;
};

/// Where to look.
struct SearchArea {
  std::vector<Pose> centres_odom;  ///< roll and pitch do not count
  double radius_m{0.0};            ///< about each of them
  double yaw_rad{0.0};             ///< to either side of its heading
  /// The robot is known to be in the area: places as good in one piece are no rivals, the nearest
  /// to the centre is taken. Heights are the centres' own, not the ground's.
  bool holds_robot{false};
  /// Then, how uncertain the robot is about its centre, in the plane.
  double sigma_m{0.0};
};

struct Registration {
  Pose T_odom_base;
  double share{0.0};            ///< mean likelihood of the points that stand out: 1 on the map
  double runner_up_share{0.0};  ///< of the best place that is another one
  /// Scatter of the places around that are as good, in the plane of odom: large along a corridor.
  Eigen::Matrix2d spread_m2{Eigen::Matrix2d::Zero()};
  Pose centre;  ///< of the search area, from which the search came there
};

struct RegistrationResult {
  std::optional<Registration> best;  ///< also when it is not accepted
  bool accepted{false};
  std::string obstacle;  ///< why it is not
};

/// Correlative search (Olson, Real-time correlative scan matching, ICRA 2009): a grid of places and
/// headings, at the expected height and on the ground, is scored by where the points that stand out
/// of it come to lie in the map's likelihood field; the best few climb within their cell of the
/// grid, and the first is refined with the iterated matcher. Accepted where enough of what stands
/// out lies on the map and clearly more than at any other place. Deterministic for any number of
/// workers. Throws std::invalid_argument when the area has no centre.
RegistrationResult register_scan(const LevelScan& scan,
                                 const LocalMap& map,
                                 const SearchArea& area,
                                 const MatchingConfig& matching,
                                 const RecoveryConfig& config,
                                 Workers& workers);

}  // namespace trigpoint::lio_mapper
