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
#include <limits>
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
  /// The best place is not believed when it lies farther than this from its centre, in the plane.
  double farthest_m{std::numeric_limits<double>::infinity()};
};

struct Registration {
  Pose T_odom_base;
  double share{0.0};            ///< of the points that stand out, within 10 cm of their planes
  double fit{0.0};              ///< of those that meet a plane at all, within 10 cm of it
  double runner_up_share{0.0};  ///< of the best place that is another one
  double chi2{0.0};             ///< per point that lies within 10 cm; near 1 when all is well
  Pose centre;                  ///< of the search area, from which the search came there
};

struct RegistrationResult {
  std::optional<Registration> best;  ///< also when it is not accepted
  bool accepted{false};
  std::string obstacle;  ///< why it is not
};

/// A grid of places and headings, each put on the ground, is scored with some hundred points that
/// stand out of the ground; the best few, apart from each other, climb within their cell of the
/// grid and are refined with the iterated matcher against all points. Accepted only when most of
/// the points that stand out lie on the map, clearly more than at any other place. Deterministic
/// for any number of workers.
RegistrationResult register_scan(const LevelScan& scan,
                                 const LocalMap& map,
                                 const SearchArea& area,
                                 const MatchingConfig& matching,
                                 const RecoveryConfig& config,
                                 Workers& workers);

}  // namespace trigpoint::lio_mapper
