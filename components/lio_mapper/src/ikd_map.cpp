// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ikd_map.hpp"

#include "trigpoint/base/point_cloud.hpp"

#include "plane_fit.hpp"

#include <algorithm>
#include <array>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

constexpr std::size_t kPlanePoints = 5;

}  // namespace

IkdMap::IkdMap(const IkdMapConfig& config) : config_(config) {}

bool IkdMap::match_surface(const Vector3d& point_odom_m, PlaneMatch& plane) const {
  std::array<IkdTree::Neighbour, kPlanePoints> found;
  const std::size_t count =
      tree_.nearest(point_odom_m.cast<float>(), static_cast<float>(config_.max_neighbour_m), found);
  if (count < kPlanePoints) {
    return false;
  }
  // About the nearest one, so that nothing is lost far from the origin.
  const Vector3d origin = found[0].position_m.cast<double>();
  std::array<Vector3d, kPlanePoints> points;
  std::transform(found.begin(), found.end(), points.begin(), [&](const auto& neighbour) {
    return Vector3d(neighbour.position_m.template cast<double>() - origin);
  });
  const auto fit = fit_neighbours(points, config_.max_plane_distance_m);
  if (!fit) {
    return false;
  }
  plane.normal = fit->normal;
  plane.offset_m = -fit->normal.dot(fit->centroid + origin);
  plane.thickness2_m2 = thickness2_of_neighbours_m2(*fit, kPlanePoints);
  plane.tilt2_rad2 = tilt2_rad2(*fit, plane.thickness2_m2, kPlanePoints);
  return true;
}

void IkdMap::insert(const PointCloud& points_odom) {
  tree_.insert_thinned(points_odom, static_cast<float>(config_.voxel_m));
}

void IkdMap::prune(const Vector3d& center_odom_m, double half_side_m) {
  const Vector3d half = Vector3d::Constant(half_side_m);
  tree_.erase_outside(
      IkdTree::Box((center_odom_m - half).cast<float>(), (center_odom_m + half).cast<float>()));
}

void IkdMap::transform(const Pose& T_new_old) {
  tree_.build(moved(tree_.points(), T_new_old));
}

void IkdMap::rebuild(const PointCloud& points_odom) {
  tree_.build({});
  insert(points_odom);
}

std::unique_ptr<LocalMap> make_ikd_map(const IkdMapConfig& config) {
  return std::make_unique<IkdMap>(config);
}

}  // namespace trigpoint::lio_mapper
