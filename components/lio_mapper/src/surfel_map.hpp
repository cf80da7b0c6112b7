// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "local_map.hpp"
#include "plane_fit.hpp"
#include "voxel_key.hpp"
#include <Eigen/Core>
#include <tsl/robin_map.h>

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace trigpoint::lio_mapper {

/// Two-level voxel hash: leaves hold the running mean of at most `leaf_capacity` points, parents of
/// 3 x 3 x 3 leaves hold a plane through the leaf means, fitted when it is first asked for.
///
/// Planes are boundary-aware, so that a surface that runs along a face of a parent is as good as
/// any other: the fit also sees the leaves of the neighbouring parents that touch this one, and a
/// query near a face also looks behind it.
///
/// Between two insertions a plane is a function of the leaves alone, not of who asked first, so
/// threads that match at once all get the same bits.
class SurfelMap final : public LocalMap {
 public:
  explicit SurfelMap(const SurfelMapConfig& config);

  bool match(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const override;
  void insert(const PointCloud& points_odom) override;
  void prune(const Eigen::Vector3d& center_odom_m, double half_side_m) override;
  /// Leaf means keep their weights; leaves are laid anew.
  void transform(const Pose& T_new_old) override;
  void rebuild(const PointCloud& points_odom) override;
  /// The means of the leaves, in the order of their parents' creation.
  PointCloud points() const override;

  /// Number of leaves.
  std::size_t size() const override { return leaf_count_; }

  std::size_t memory_bytes() const override;

 private:
  using ParentId = std::int32_t;
  static constexpr ParentId kNoParent = -1;
  static constexpr int kLeaves = 27;  // of a parent; also the parents around one, itself included
  static constexpr int kCentre = 13;  // itself

  /// Relative to the parent's centre, so that float keeps micrometres far from the origin.
  struct LeafMean {
    float x{0.0F};
    float y{0.0F};
    float z{0.0F};
    float intensity{0.0F};
  };

  /// A point of a leaf, from the parent's centre in parts of `stored_unit_m_`.
  struct StoredPoint {
    std::int16_t x{0};
    std::int16_t y{0};
    std::int16_t z{0};
  };

  struct Parent {
    VoxelIndex index;
    std::uint32_t occupied{0};  ///< bit i: leaf i has points
    std::array<LeafMean, kLeaves> means{};
    std::array<StoredPoint, kLeaves> points{};  ///< the one nearest the leaf's centre
    std::array<std::uint16_t, kLeaves> counts{};
    std::array<ParentId, kLeaves> neighbours{};
  };

  struct NearPoint {
    double distance2_m2{std::numeric_limits<double>::infinity()};
    Eigen::Vector3d offset_m{Eigen::Vector3d::Zero()};
  };

  static constexpr int kNearestPoints = 5;
  using NearestPoints = std::array<NearPoint, kNearestPoints>;

  enum State : std::uint32_t { kDirty, kFitting, kPlane, kNoPlane };

  /// One cache line; apart from Parent because a match reads this and little else.
  struct Surfel {
    Eigen::Vector3d normal{Eigen::Vector3d::UnitZ()};
    Eigen::Vector3d centroid_odom_m{Eigen::Vector3d::Zero()};
    double thickness2_m2{0.0};
    float tilt2_rad2{0.0F};
    std::uint32_t state{kDirty};  ///< a State, read and written through std::atomic_ref
  };

  /// Leaves around a parent, grouped so that smaller windows can be put together from them.
  struct Window {
    Moments own;
    std::array<Moments, 3> slabs;  ///< behind the two faces of each axis
    Moments corners;               ///< behind edges and corners
  };

  ParentId find(const VoxelIndex& index) const;
  ParentId find_or_create(const VoxelIndex& index);
  void link(ParentId id);
  void clear();
  void insert_mean(const PointXyzi& mean, std::uint16_t count);
  VoxelIndex leaf_for(const Eigen::Vector3d& point_odom_m) const;
  std::optional<Eigen::Vector3d> mean_of(const VoxelIndex& leaf) const;

  Eigen::Vector3d local(const StoredPoint& point) const {
    return stored_unit_m_ * Eigen::Vector3d(point.x, point.y, point.z);
  }

  StoredPoint stored(const Eigen::Vector3d& local_m) const;
  void keep_centre_most(Parent& parent,
                        const VoxelIndex& inner,
                        const Eigen::Vector3d& local_m,
                        bool first) const;
  void mark_dirty(const Parent& parent, const VoxelIndex& leaf);
  Eigen::Vector3d centre_of(const Parent& parent) const;
  void forget_leaves_outside(Parent& parent, const Eigen::Vector3d& centre, double half_side_m);
  void erase_empty_parents();

  std::array<ParentId, 8> candidates(const Eigen::Vector3d& point_odom_m) const;
  const Surfel* surfel(ParentId id, Surfel& scratch) const;
  void offer_points(const Parent& parent,
                    const Eigen::Vector3d& point_odom_m,
                    NearestPoints& nearest) const;
  bool match_nearest_points(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const;
  Surfel fit(const Parent& parent) const;
  bool is_surface(const Parent& parent, const PlaneFit& plane) const;
  Window window_of(const Parent& parent) const;
  std::optional<PlaneFit> plane_of(const Window& window) const;
  std::optional<PlaneFit> flat_fit(const Moments& moments) const;

  SurfelMapConfig config_;
  double inverse_leaf_per_m_;
  double parent_m_;
  double inverse_parent_per_m_;
  double stored_unit_m_;
  std::size_t leaf_count_{0};
  std::vector<Parent> parents_;
  mutable std::vector<Surfel> surfels_;  ///< same indices; mutable because fitting is lazy
  tsl::robin_map<VoxelKey, ParentId, VoxelKeyHash> index_;
};

}  // namespace trigpoint::lio_mapper
