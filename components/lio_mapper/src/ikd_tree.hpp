// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// An incremental k-d tree.
// References: [1] Y. Cai, W. Xu, F. Zhang, "ikd-Tree: An Incremental K-D Tree for Robotic
// Applications", arXiv:2102.10808: incremental updates, on-tree down-sampling, box-wise deletion,
// re-balancing by partial rebuild beside the main thread. [2] J. L. Bentley, "Multidimensional
// binary search trees used for associative searching", CACM 1975. [3] J. H. Friedman, J. L.
// Bentley, R. A. Finkel, "An algorithm for finding best matches in logarithmic expected time", ACM
// TOMS 1977: buckets in the leaves.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "voxel_key.hpp"
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <span>
#include <vector>

namespace trigpoint::lio_mapper {

/// When a subtree is rebuilt; the names of [1].
struct IkdTreeLimits {
  double unbalanced_share{0.65};    ///< a child with more of its parent's points (alpha_bal)
  double deleted_share{0.5};        ///< of the points that a subtree once had (alpha_del)
  std::size_t rebuilt_aside{1500};  ///< larger subtrees are rebuilt beside the caller's thread
};

/// Points in a k-d tree that changes while it is used.
///
/// What it answers is a function of the points alone, never of the tree's shape: neighbours at
/// equal distance are ordered by coordinates, `points` is sorted. So a rebuild that ends earlier or
/// later changes nothing but the time of a query.
///
/// Deletion is lazy: a point leaves its bucket and a box its whole subtrees, while splits and
/// bounds stay as they are until a rebuild. A rebuild beside the caller works on a copy; what
/// changes meanwhile is written down and done again on the new subtree before it takes its place.
class IkdTree {
 public:
  using Box = Eigen::AlignedBox3f;

  struct Neighbour {
    float distance2_m2{0.0F};
    Eigen::Vector3f position_m{Eigen::Vector3f::Zero()};
  };

  explicit IkdTree(const IkdTreeLimits& limits = {});
  ~IkdTree();
  IkdTree(const IkdTree&) = delete;
  IkdTree& operator=(const IkdTree&) = delete;

  /// Replaces everything by a balanced tree of all `points`.
  void build(const PointCloud& points);
  /// Adds all `points` as they are.
  void insert(std::span<const PointXyzi> points);
  /// Of the points in the same voxel, those in the tree included, the one nearest the voxel's
  /// centre stays ([1], on-tree down-sampling). Voxels are aligned with the axes at the origin.
  void insert_thinned(std::span<const PointXyzi> points, float voxel_m);
  void erase_inside(const Box& box);
  void erase_outside(const Box& box);

  /// The nearest points to `query_m`, at most as many as `found` has room for, none farther than
  /// `max_distance_m`, nearest first. Returns their number. Safe to call from several threads at
  /// once between two changes.
  std::size_t nearest(const Eigen::Vector3f& query_m,
                      float max_distance_m,
                      std::span<Neighbour> found) const;

  std::size_t size() const;

  bool empty() const { return size() == 0; }

  /// All points, sorted by x, y, z.
  PointCloud points() const;

  /// Waits until no rebuild is under way or due.
  void finish_rebuilds();

  /// Of the tree's shape; for tests and benchmarks.
  std::size_t depth() const;

  std::uint64_t rebuilds_aside() const { return rebuilds_aside_; }

  std::size_t memory_bytes() const;

 private:
  struct Node;
  struct Bounds;
  struct Search;
  using NodePtr = std::unique_ptr<Node>;

  /// What happened to a subtree while its replacement was being built.
  struct Change {
    enum class Kind : std::uint8_t { kInsert, kErase, kEraseInside, kEraseOutside };
    Kind kind{Kind::kInsert};
    PointXyzi point;
    Box box;
  };

  /// A rebuild under way: which subtree, how to get there, what must be done again.
  struct Rebuild {
    const Node* target{nullptr};
    std::vector<bool> way;  ///< from the root: to the right?
    std::vector<Change> changes;
    std::future<NodePtr> result;
  };

  static NodePtr build_subtree(std::span<PointXyzi> points);
  static void collect(const Node& node, PointCloud& points);
  static std::size_t depth_of(const Node& node);
  static std::size_t memory_of(const Node& node);
  static void search(const Node& node, Search& search);
  static void find_in_voxel(const Node& node,
                            const Bounds& around,
                            const VoxelIndex& voxel,
                            float inverse_voxel_per_m,
                            PointCloud& found);
  static void split_leaf(Node& leaf);

  void add(Node& node, const PointXyzi& point);
  bool take_out(Node& node, const PointXyzi& point);
  void erase_box(Node& node, const Box& box, bool inside);
  void erase(const Box& box, bool inside);
  void unlink(Node& node);
  bool is_better_than_its_voxel(const PointXyzi& point, float voxel_m);
  void apply(Node& node, const Change& change);

  bool out_of_balance(const Node& node) const;
  void restore_balance(NodePtr& node, std::vector<bool>& way);
  void start_rebuild(const NodePtr& node, const std::vector<bool>& way);
  void take_rebuild_if_done();
  void put_in_place(NodePtr subtree);
  void finish_change();

  IkdTreeLimits limits_;
  NodePtr root_;
  std::vector<NodePtr> garbage_;  ///< unlinked; freed by the next rebuild aside
  Rebuild rebuild_;
  PointCloud scratch_;
  std::uint64_t rebuilds_aside_{0};
};

}  // namespace trigpoint::lio_mapper
