// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <memory>

namespace trigpoint::lio_mapper {

/// A plane of the local map near a point: n . p + d = 0, |n| = 1, in odom.
struct PlaneMatch {
  Eigen::Vector3d normal{Eigen::Vector3d::UnitZ()};
  double offset_m{0.0};       ///< d
  double thickness2_m2{0.0};  ///< variance of the map's points across the plane
  double tilt2_rad2{0.0};     ///< variance of the normal's direction, about its worse axis
};

/// What the estimator asks of a local map. All coordinates in odom.
class LocalMap {
 public:
  virtual ~LocalMap() = default;

  /// The plane that explains `point_odom_m`, or false where none holds. Safe to call from several
  /// threads at once between two changes of the map.
  bool match(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const {
    return match_surface(point_odom_m, plane) || match_nearest(point_odom_m, plane);
  }

  /// The first and cheap part of `match`, ...
  virtual bool match_surface(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const = 0;

  /// ... and the dear part, for points that it leaves without a plane.
  virtual bool match_nearest(const Eigen::Vector3d& /*point_odom_m*/, PlaneMatch& /*plane*/) const {
    return false;
  }

  /// Whether match_nearest() may find what match_surface() does not.
  virtual bool has_nearest() const { return false; }

  virtual void insert(const PointCloud& points_odom) = 0;
  /// Forgets what lies outside the axis-aligned cube around `center_odom_m`.
  virtual void prune(const Eigen::Vector3d& center_odom_m, double half_side_m) = 0;
  /// Moves everything: p_new = T_new_old p_old.
  virtual void transform(const Pose& T_new_old) = 0;
  /// Forgets everything and starts from `points_odom`.
  virtual void rebuild(const PointCloud& points_odom) = 0;
  virtual PointCloud points() const = 0;
  virtual std::size_t size() const = 0;
  virtual std::size_t memory_bytes() const = 0;

  virtual bool empty() const { return size() == 0; }
};

std::unique_ptr<LocalMap> make_surfel_map(const SurfelMapConfig& config);
std::unique_ptr<LocalMap> make_ikd_map(const IkdMapConfig& config);
/// The one that `config.kind` names.
std::unique_ptr<LocalMap> make_local_map(const LocalMapConfig& config);

}  // namespace trigpoint::lio_mapper
