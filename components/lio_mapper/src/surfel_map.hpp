// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "local_map.hpp"
#include "plane_fit.hpp"
#include "voxel_key.hpp"
#include <Eigen/Core>

#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace trigpoint::lio_mapper {

/// Two-level voxel hash: leaves hold the running mean of at most `leaf_capacity` points, parents of
/// 3 x 3 x 3 leaves hold a plane through the leaf means, fitted when it is first asked for.
///
/// Planes are boundary-aware, so that a surface that runs along a face of a parent is as good as
/// any other: the fit also sees the leaves of the neighbouring parents that touch this one, and a
/// query near a face also looks behind it.
///
/// Kept small, because a search costs what it fetches from memory: 64 bytes a parent, 16 a leaf.
/// Coordinates of a parent's leaves are 16-bit numbers from its centre, in units of 28 micrometres.
///
/// A plane is fitted again when more than an eighth of its leaves have changed. Between two
/// insertions it does not depend on who asks first, so threads that match at once all get the same
/// bits.
class SurfelMap final : public LocalMap {
 public:
  explicit SurfelMap(const SurfelMapConfig& config);

  bool match_surface(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const override;
  bool match_nearest(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const override;

  bool has_nearest() const override { return config_.nearest_points; }

  void insert(const PointCloud& points_odom) override;
  void prune(const Eigen::Vector3d& center_odom_m, double half_side_m) override;
  /// Leaf means keep their weights; leaves are laid anew, the means as their single points.
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

  /// From the parent's centre, in `unit_m_`.
  struct Offset {
    std::int16_t x{0};
    std::int16_t y{0};
    std::int16_t z{0};
  };

  struct Leaf {
    Offset mean;
    std::uint16_t count{0};           ///< points in the mean
    Offset point;                     ///< of them the one nearest the leaf's centre, ...
    Eigen::bfloat16 intensity{0.0F};  ///< ... and its intensity
  };

  static_assert(sizeof(Leaf) == 16);

  struct Plane {
    Eigen::Vector3f normal{Eigen::Vector3f::UnitZ()};
    Eigen::Vector3f centroid_m{Eigen::Vector3f::Zero()};  ///< from the parent's centre
    float thickness2_m2{0.0F};
    float tilt2_rad2{0.0F};
  };

  enum State : std::uint32_t { kDirty, kFitting, kPlane, kNoPlane };

  struct alignas(64) Parent {
    VoxelIndex index;
    std::uint32_t occupied{0};    ///< bit i: leaf i has points
    std::uint32_t neighbours{0};  ///< bit d: there is a parent in that direction
    std::uint32_t first_leaf{0};  ///< in `leaves_`, where they stand in the order of their bits
    Plane plane;
    std::uint32_t state{kDirty};  ///< a State, read and written through std::atomic_ref
    std::uint8_t size_class{0};   ///< how many leaves there is room for
    std::uint8_t changes{0};      ///< of leaves that the plane sees, since it was fitted
    std::uint8_t tolerated{0};    ///< so many of them
  };

  static_assert(sizeof(Parent) == 64);

  /// Where a leaf is, or would be.
  struct Place {
    VoxelIndex home;   ///< of the parent
    VoxelIndex inner;  ///< of the leaf in it
    ParentId id{kNoParent};
  };

  struct NearPoint {
    double distance2_m2{std::numeric_limits<double>::infinity()};
    Eigen::Vector3d offset_m{Eigen::Vector3d::Zero()};
  };

  static constexpr int kNearestPoints = 5;
  using NearestPoints = std::array<NearPoint, kNearestPoints>;

  /// Leaves around a parent, grouped so that smaller windows can be put together from them.
  struct Window {
    Moments own;
    std::array<Moments, 3> slabs;  ///< behind the two faces of each axis
    Moments corners;               ///< behind edges and corners

    Moments all() const {
      Moments sum = own;
      sum += corners;
      for (const Moments& slab : slabs) {
        sum += slab;
      }
      return sum;
    }
  };

  const Parent& parent(ParentId id) const { return parents_[static_cast<std::size_t>(id)]; }

  /// In the order of their bits.
  std::span<const Leaf> leaves_of(const Parent& parent) const {
    return {leaves_.data() + parent.first_leaf,
            static_cast<std::size_t>(std::popcount(parent.occupied))};
  }

  ParentId find(const VoxelIndex& index) const;
  ParentId neighbour(const Parent& parent, int direction) const;
  /// The same around a place whose parent is `own`, if there is one.
  ParentId neighbour(const VoxelIndex& home, ParentId own, int direction) const;
  ParentId find_or_create(const Place& place);
  void put_into_table(ParentId id);
  void link(ParentId id);
  void unlink(const Parent& parent);
  void clear();

  void insert_mean(const PointXyzi& mean, std::uint16_t count);
  Place place_of(const VoxelIndex& leaf) const;
  Place place_for(const Eigen::Vector3d& point_odom_m) const;
  const Leaf* leaf_at(const Place& place) const;
  Leaf& make_leaf(Parent& parent, int slot);
  void move_leaves(Parent& parent, std::uint8_t size_class);
  enum class Change { kOfSome, kForGood };
  void mark_dirty(const Parent& parent, const VoxelIndex& leaf, Change change);

  Eigen::Vector3d metres(const Offset& offset) const {
    return unit_m_ * Eigen::Vector3d(offset.x, offset.y, offset.z);
  }

  Offset offset_of(const Eigen::Vector3d& local_m) const;
  Eigen::Vector3d centre_of(const Parent& parent) const;
  void forget_leaves_outside(Parent& parent, const Eigen::Vector3d& centre, double half_side_m);
  void erase_empty_parents();

  std::optional<Plane> plane_of(ParentId id) const;
  void offer_points(const Parent& parent,
                    const Eigen::Vector3d& point_odom_m,
                    NearestPoints& nearest) const;
  std::optional<Plane> fit(const Parent& parent, int& leaves) const;
  bool is_surface(const Parent& parent, const PlaneFit& plane) const;
  Window window_of(const Parent& parent) const;
  std::optional<PlaneFit> flat_fit(const Window& window) const;
  std::optional<PlaneFit> flat_fit(const Moments& moments) const;

  SurfelMapConfig config_;
  double inverse_leaf_per_m_;
  double parent_m_;
  double inverse_parent_per_m_;
  double unit_m_;
  std::size_t leaf_count_{0};
  mutable std::vector<Parent> parents_;  ///< mutable because planes are fitted when asked for
  std::vector<Leaf> leaves_;             ///< in blocks of the size classes
  std::array<std::vector<std::uint32_t>, 7> free_blocks_;  ///< of each size class
  std::vector<ParentId> table_;  ///< open addressing by parents' indices, a power of two long
};

}  // namespace trigpoint::lio_mapper
