// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "ikd_tree.hpp"
#include "local_map.hpp"

namespace trigpoint::lio_mapper {

/// FAST-LIO2's local map [W. Xu et al., FAST-LIO2, T-RO 2022, section V]: one point a voxel in an
/// incremental k-d tree, and for each query the plane through its five nearest points.
class IkdMap final : public LocalMap {
 public:
  explicit IkdMap(const IkdMapConfig& config);

  bool match_surface(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const override;
  void insert(const PointCloud& points_odom) override;
  void prune(const Eigen::Vector3d& center_odom_m, double half_side_m) override;
  void transform(const Pose& T_new_old) override;
  void rebuild(const PointCloud& points_odom) override;

  PointCloud points() const override { return tree_.points(); }

  std::size_t size() const override { return tree_.size(); }

  std::size_t memory_bytes() const override { return tree_.memory_bytes(); }

 private:
  IkdMapConfig config_;
  IkdTree tree_;
};

}  // namespace trigpoint::lio_mapper
