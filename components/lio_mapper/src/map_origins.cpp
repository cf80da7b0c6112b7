// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "map_origins.hpp"

#include "trigpoint/base/so3.hpp"

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

constexpr double kSide_m = 1.0;
/// Then the mean is frozen, about when the map's own leaves are.
constexpr double kMostMapPoints = 80.0;

/// The pose at `share` of the way.
Pose between(const Pose& from, const Pose& to, double share) {
  return {(from.q * so3_exp(share * so3_log(from.q.conjugate() * to.q))).normalized(),
          from.p + share * (to.p - from.p)};
}

}  // namespace

std::optional<VoxelKey> MapOrigins::key_of(const Vector3d& p) {
  constexpr double kInverse = 1.0 / kSide_m;
  if (!voxel_index_fits(p.x(), p.y(), p.z(), kInverse)) {
    return std::nullopt;
  }
  return voxel_key(voxel_index(p.x(), p.y(), p.z(), kInverse));
}

void MapOrigins::insert(const PointCloud& points_odom,
                        const Pose& T_odom_base,
                        const Pose& T_base_lidar) {
  for (const PointXyzi& point : points_odom) {
    const Vector3d p = point.position().cast<double>();
    const auto key = key_of(p);
    if (!key) {
      continue;
    }
    Mean& mean = voxels_[*key];
    if (mean.count >= kMostMapPoints) {
      continue;
    }
    mean.count += 1.0;
    if (mean.count == 1.0) {
      mean.origin = {T_odom_base, T_base_lidar};
      mean.center_m = p;
      continue;
    }
    const double share = 1.0 / mean.count;
    mean.origin.T_odom_base = between(mean.origin.T_odom_base, T_odom_base, share);
    mean.origin.T_base_lidar = between(mean.origin.T_base_lidar, T_base_lidar, share);
  }
}

void MapOrigins::prune(const Vector3d& center_odom_m, double half_side_m) {
  for (auto it = voxels_.begin(); it != voxels_.end();) {
    const bool inside = (it->second.center_m - center_odom_m).cwiseAbs().maxCoeff() <= half_side_m;
    it = inside ? std::next(it) : voxels_.erase(it);
  }
}

const MapOrigin* MapOrigins::find(const Vector3d& point_odom_m) const {
  const auto key = key_of(point_odom_m);
  const auto found = key ? voxels_.find(*key) : voxels_.end();
  return found == voxels_.end() ? nullptr : &found->second.origin;
}

}  // namespace trigpoint::lio_mapper
