// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>

#include "trigpoint/base/measurements.hpp"

namespace trigpoint::lio_mapper {

/// A plane of the local map near a point: n . p + d = 0, |n| = 1, in odom.
struct PlaneMatch {
  Eigen::Vector3d normal{Eigen::Vector3d::UnitZ()};
  double offset_m{0.0};          ///< d
  double thickness2_m2{0.0};     ///< variance of the map's points across the plane
};

/// What the estimator asks of a local map. All coordinates in odom.
class LocalMap {
 public:
  virtual ~LocalMap() = default;

  /// The plane that explains `point_odom_m`, or false where none holds. Safe to call from several
  /// threads at once between two changes of the map.
  virtual bool match(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const = 0;
  virtual void insert(const PointCloud& points_odom) = 0;
  /// Forgets what lies outside the axis-aligned cube around `center_odom_m`.
  virtual void prune(const Eigen::Vector3d& center_odom_m, double half_side_m) = 0;
  virtual PointCloud points() const = 0;
  virtual std::size_t size() const = 0;
  virtual bool empty() const { return size() == 0; }
};

struct SurfelMapConfig {
  double leaf_m{0.5};               ///< side of a leaf voxel; a parent is 3 x 3 x 3 leaves
  std::size_t leaf_capacity{20};    ///< points after which a leaf's mean is frozen
  double max_flatness{0.03};        ///< smallest over largest eigenvalue of a plane's leaf means
  double min_linearity{0.1};        ///< middle over largest eigenvalue, so that a line is no plane
  double max_residual_m{0.5};       ///< farther planes do not explain a point
};

std::unique_ptr<LocalMap> make_surfel_map(const SurfelMapConfig& config);

}  // namespace trigpoint::lio_mapper
