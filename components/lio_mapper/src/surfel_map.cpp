// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "surfel_map.hpp"

#include "surfel_grid.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

namespace trigpoint::lio_mapper {

using surfel_grid::floor_div3;
using surfel_grid::kSide;
using surfel_grid::neighbour_index;
using surfel_grid::slot;

namespace {

/// A point nearer than this to the face of an empty leaf may belong to the leaf behind the face, in
/// parts of a leaf's side (5 cm of 0.5 m: 2.5 sigma of a LiDAR's range noise), ...
constexpr double kFaceBand = 0.1;
/// ... namely when that leaf's mean is this near to the point across the face.
constexpr double kSameSurface = 0.2;

/// A point may lie outside the leaf that it belongs to, by the band above: in parts of a parent's
/// side.
constexpr double kStoredReach = 0.6;

/// Planes are fitted anew when a leaf has 1, 2, 3, 5, 8, 13, ... points: in between its mean moves
/// by less than its own noise, and fitting is most of the map's cost.
bool matters_to_planes(std::size_t count, std::size_t capacity) {
  std::size_t a = 1;
  std::size_t b = 2;
  while (a < count) {
    a = std::exchange(b, a + b);
  }
  return a == count || count == capacity;
}

}  // namespace

SurfelMap::SurfelMap(const SurfelMapConfig& config)
    : config_(config),
      inverse_leaf_per_m_(1.0 / config.leaf_m),
      parent_m_(kSide * config.leaf_m),
      inverse_parent_per_m_(1.0 / parent_m_),
      stored_unit_m_(kStoredReach * parent_m_ / std::numeric_limits<std::int16_t>::max()) {
  if (!(config.leaf_m > 0.0) || !std::isfinite(config.leaf_m)) {
    throw std::invalid_argument("surfel map: leaf_m is " + std::to_string(config.leaf_m) +
                                ", expected a positive length");
  }
  config_.leaf_capacity =
      std::clamp<std::size_t>(config.leaf_capacity, 1, std::numeric_limits<std::uint16_t>::max());
}

// ---- Insertion -------------------------------------------------------------------------------

void SurfelMap::insert(const PointCloud& points_odom) {
  for (const PointXyzi& point : points_odom) {
    if (voxel_index_fits(point.x, point.y, point.z, inverse_leaf_per_m_)) {
      insert_mean(point, 1);
    }
  }
}

/// `count` points whose mean this is.
void SurfelMap::insert_mean(const PointXyzi& point, std::uint16_t count) {
  const VoxelIndex leaf = leaf_for(point.position().cast<double>());
  const VoxelIndex home{floor_div3(leaf.x), floor_div3(leaf.y), floor_div3(leaf.z)};
  Parent& parent = parents_[static_cast<std::size_t>(find_or_create(home))];
  const VoxelIndex inner{leaf.x - kSide * home.x, leaf.y - kSide * home.y, leaf.z - kSide * home.z};
  const auto i = static_cast<std::size_t>(slot(inner.x, inner.y, inner.z));
  if (parent.counts[i] >= config_.leaf_capacity) {
    return;
  }
  const bool first = parent.counts[i] == 0;
  leaf_count_ += first ? 1 : 0;
  parent.occupied |= 1U << i;
  parent.counts[i] = static_cast<std::uint16_t>(
      std::min<std::size_t>(parent.counts[i] + std::size_t{count}, config_.leaf_capacity));
  const float share =
      static_cast<float>(std::min(count, parent.counts[i])) / static_cast<float>(parent.counts[i]);
  const Eigen::Vector3d local_m = point.position().cast<double>() - centre_of(parent);
  keep_centre_most(parent, inner, local_m, first);
  const Eigen::Vector3f local = local_m.cast<float>();
  LeafMean& mean = parent.means[i];
  mean.x += share * (local.x() - mean.x);
  mean.y += share * (local.y() - mean.y);
  mean.z += share * (local.z() - mean.z);
  mean.intensity +=
      share * ((std::isfinite(point.intensity) ? point.intensity : 0.0F) - mean.intensity);
  if (matters_to_planes(parent.counts[i], config_.leaf_capacity)) {
    mark_dirty(parent, inner);
  }
}

SurfelMap::StoredPoint SurfelMap::stored(const Eigen::Vector3d& local_m) const {
  const auto number = [this](double value_m) {
    return static_cast<std::int16_t>(std::lround(value_m / stored_unit_m_));
  };
  return {number(local_m.x()), number(local_m.y()), number(local_m.z())};
}

void SurfelMap::keep_centre_most(Parent& parent,
                                 const VoxelIndex& inner,
                                 const Eigen::Vector3d& local_m,
                                 bool first) const {
  StoredPoint& kept = parent.points[static_cast<std::size_t>(slot(inner.x, inner.y, inner.z))];
  const Eigen::Vector3d centre_m =
      config_.leaf_m * Eigen::Vector3d(inner.x - 1, inner.y - 1, inner.z - 1);
  if (first || (local_m - centre_m).squaredNorm() < (local(kept) - centre_m).squaredNorm()) {
    kept = stored(local_m);
  }
}

/// The leaf that a point belongs to. Where a surface runs along a face of the leaves, its noise
/// would fill a leaf on either side, both with biased means and of equal weight whatever the share
/// of the points: up to 0.6 sigma of error. So the leaf that was there first keeps the whole
/// surface.
VoxelIndex SurfelMap::leaf_for(const Eigen::Vector3d& point_odom_m) const {
  const Eigen::Vector3d cells = point_odom_m * inverse_leaf_per_m_;
  const VoxelIndex leaf = voxel_index(cells.x(), cells.y(), cells.z(), 1.0);
  const Eigen::Vector3d within = cells - Eigen::Vector3d(leaf.x, leaf.y, leaf.z);
  const Eigen::Array3d to_face = within.array().min(1.0 - within.array());
  if (to_face.minCoeff() > kFaceBand || mean_of(leaf)) {
    return leaf;
  }
  for (const Eigen::Index axis : {2, 1, 0}) {
    if (to_face[axis] > kFaceBand) {
      continue;
    }
    VoxelIndex behind = leaf;
    (axis == 0 ? behind.x : axis == 1 ? behind.y : behind.z) += within[axis] < 0.5 ? -1 : 1;
    const auto mean_odom_m = mean_of(behind);
    if (mean_odom_m &&
        std::abs((*mean_odom_m)[axis] - point_odom_m[axis]) < kSameSurface * config_.leaf_m) {
      return behind;
    }
  }
  return leaf;
}

std::optional<Eigen::Vector3d> SurfelMap::mean_of(const VoxelIndex& leaf) const {
  const VoxelIndex home{floor_div3(leaf.x), floor_div3(leaf.y), floor_div3(leaf.z)};
  const ParentId id = find(home);
  if (id == kNoParent) {
    return std::nullopt;
  }
  const Parent& parent = parents_[static_cast<std::size_t>(id)];
  const auto i = static_cast<std::size_t>(
      slot(leaf.x - kSide * home.x, leaf.y - kSide * home.y, leaf.z - kSide * home.z));
  if (parent.counts[i] == 0) {
    return std::nullopt;
  }
  const LeafMean& mean = parent.means[i];
  return centre_of(parent) + Eigen::Vector3d(mean.x, mean.y, mean.z);
}

/// The planes that see this leaf: its own parent's and those of the parents it touches.
void SurfelMap::mark_dirty(const Parent& parent, const VoxelIndex& leaf) {
  const auto first = [](std::int32_t i) { return i == 0 ? 0 : 1; };
  const auto last = [](std::int32_t i) { return i == kSide - 1 ? 2 : 1; };
  for (int x = first(leaf.x); x <= last(leaf.x); ++x) {
    for (int y = first(leaf.y); y <= last(leaf.y); ++y) {
      for (int z = first(leaf.z); z <= last(leaf.z); ++z) {
        const ParentId id = parent.neighbours[static_cast<std::size_t>(slot(x, y, z))];
        if (id != kNoParent) {
          surfels_[static_cast<std::size_t>(id)].state = kDirty;
        }
      }
    }
  }
}

SurfelMap::ParentId SurfelMap::find(const VoxelIndex& index) const {
  const auto entry = index_.find(voxel_key(index));
  return entry == index_.end() ? kNoParent : entry->second;
}

SurfelMap::ParentId SurfelMap::find_or_create(const VoxelIndex& index) {
  const auto id = static_cast<ParentId>(parents_.size());
  const auto [entry, is_new] = index_.try_emplace(voxel_key(index), id);
  if (!is_new) {
    return entry->second;
  }
  parents_.emplace_back().index = index;
  surfels_.emplace_back();
  link(id);
  return id;
}

void SurfelMap::link(ParentId id) {
  Parent& parent = parents_[static_cast<std::size_t>(id)];
  for (int d = 0; d < kLeaves; ++d) {
    const ParentId other = d == kCentre ? id : find(neighbour_index(parent.index, d));
    parent.neighbours[static_cast<std::size_t>(d)] = other;
    if (other != kNoParent) {
      const auto opposite = static_cast<std::size_t>(kLeaves - 1 - d);
      parents_[static_cast<std::size_t>(other)].neighbours[opposite] = id;
    }
  }
}

Eigen::Vector3d SurfelMap::centre_of(const Parent& parent) const {
  return parent_m_ *
         Eigen::Vector3d(parent.index.x + 0.5, parent.index.y + 0.5, parent.index.z + 0.5);
}

// ---- Forgetting ------------------------------------------------------------------------------

void SurfelMap::prune(const Eigen::Vector3d& center_odom_m, double half_side_m) {
  bool some_empty = false;
  for (Parent& parent : parents_) {
    const double farthest =
        (centre_of(parent) - center_odom_m).cwiseAbs().maxCoeff() + 0.5 * parent_m_;
    if (!(farthest <= half_side_m)) {
      forget_leaves_outside(parent, center_odom_m, half_side_m);
      some_empty = some_empty || parent.occupied == 0;
    }
  }
  if (some_empty) {
    erase_empty_parents();
  }
}

void SurfelMap::forget_leaves_outside(Parent& parent,
                                      const Eigen::Vector3d& center_odom_m,
                                      double half_side_m) {
  const Eigen::Vector3d origin = centre_of(parent) - center_odom_m;
  for (std::uint32_t left = parent.occupied; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    const auto at = static_cast<std::size_t>(i);
    const LeafMean& mean = parent.means[at];
    const Eigen::Vector3d from_center = origin + Eigen::Vector3d(mean.x, mean.y, mean.z);
    if (!(from_center.cwiseAbs().maxCoeff() <= half_side_m)) {
      parent.occupied &= ~(1U << i);
      parent.counts[at] = 0;
      parent.means[at] = {};
      parent.points[at] = {};
      --leaf_count_;
      mark_dirty(parent, {i / 9, i / 3 % 3, i % 3});
    }
  }
}

/// Closes the gaps without changing the order of what stays.
void SurfelMap::erase_empty_parents() {
  std::vector<ParentId> new_id(parents_.size(), kNoParent);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < parents_.size(); ++i) {
    if (parents_[i].occupied == 0) {
      index_.erase(voxel_key(parents_[i].index));
      continue;
    }
    new_id[i] = static_cast<ParentId>(kept);
    index_[voxel_key(parents_[i].index)] = new_id[i];
    if (kept != i) {
      parents_[kept] = parents_[i];
      surfels_[kept] = surfels_[i];
    }
    ++kept;
  }
  parents_.resize(kept);
  surfels_.resize(kept);
  for (Parent& parent : parents_) {
    for (ParentId& neighbour : parent.neighbours) {
      neighbour = neighbour == kNoParent ? kNoParent : new_id[static_cast<std::size_t>(neighbour)];
    }
  }
}

// ---- Laying anew -----------------------------------------------------------------------------

void SurfelMap::clear() {
  parents_.clear();
  surfels_.clear();
  index_.clear();
  leaf_count_ = 0;
}

void SurfelMap::transform(const Pose& T_new_old) {
  const std::vector<Parent> old = std::exchange(parents_, {});
  clear();
  for (const Parent& parent : old) {
    const Eigen::Vector3d centre = centre_of(parent);
    for (std::uint32_t left = parent.occupied; left != 0; left &= left - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(left));
      const LeafMean& mean = parent.means[i];
      const Eigen::Vector3f p =
          (T_new_old * (centre + Eigen::Vector3d(mean.x, mean.y, mean.z))).cast<float>();
      if (voxel_index_fits(p.x(), p.y(), p.z(), inverse_leaf_per_m_)) {
        insert_mean({p.x(), p.y(), p.z(), mean.intensity}, parent.counts[i]);
      }
    }
  }
}

void SurfelMap::rebuild(const PointCloud& points_odom) {
  clear();
  insert(points_odom);
}

std::size_t SurfelMap::memory_bytes() const {
  return parents_.capacity() * sizeof(Parent) + surfels_.capacity() * sizeof(Surfel) +
         index_.bucket_count() * (sizeof(VoxelKey) + 2 * sizeof(ParentId));
}

PointCloud SurfelMap::points() const {
  PointCloud cloud;
  cloud.reserve(leaf_count_);
  for (const Parent& parent : parents_) {
    const Eigen::Vector3d centre = centre_of(parent);
    for (std::uint32_t left = parent.occupied; left != 0; left &= left - 1) {
      const LeafMean& mean = parent.means[static_cast<std::size_t>(std::countr_zero(left))];
      const Eigen::Vector3f p = (centre + Eigen::Vector3d(mean.x, mean.y, mean.z)).cast<float>();
      cloud.push_back({p.x(), p.y(), p.z(), mean.intensity});
    }
  }
  return cloud;
}

std::unique_ptr<LocalMap> make_surfel_map(const SurfelMapConfig& config) {
  return std::make_unique<SurfelMap>(config);
}

}  // namespace trigpoint::lio_mapper
