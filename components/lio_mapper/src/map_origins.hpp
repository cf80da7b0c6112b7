// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where the robot stood when it made the local map, and with which extrinsic: a wrong extrinsic
// displaces the map as well as the scan, and a scan taken from where the map was made cannot see
// it. A filter that takes the map for exact believes to know the extrinsic after a second at rest.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"

#include "voxel_key.hpp"
#include <Eigen/Core>
#include <tsl/robin_map.h>

#include <cstddef>
#include <optional>

namespace trigpoint::lio_mapper {

/// Means over the points that made a piece of the map.
struct MapOrigin {
  Pose T_odom_base;
  Pose T_base_lidar;
};

/// One origin a voxel, whatever the local map's kind; only kept while the extrinsic is estimated.
class MapOrigins {
 public:
  void insert(const PointCloud& points_odom, const Pose& T_odom_base, const Pose& T_base_lidar);
  void prune(const Eigen::Vector3d& center_odom_m, double half_side_m);
  /// Null where nothing was put in.
  const MapOrigin* find(const Eigen::Vector3d& point_odom_m) const;

 private:
  struct Mean {
    MapOrigin origin;
    Eigen::Vector3d center_m{Eigen::Vector3d::Zero()};
    double count{0.0};
  };

  static std::optional<VoxelKey> key_of(const Eigen::Vector3d& point_odom_m);

  tsl::robin_map<VoxelKey, Mean, VoxelKeyHash> voxels_;
};

}  // namespace trigpoint::lio_mapper
