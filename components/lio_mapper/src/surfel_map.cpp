// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "surfel_map.hpp"

#include "surfel_grid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace trigpoint::lio_mapper {

using surfel_grid::floor_div3;
using surfel_grid::kFaceBand;
using surfel_grid::kSide;
using surfel_grid::neighbour_index;
using surfel_grid::slot;

namespace {

/// A point in the band along the face of an empty leaf belongs to the leaf behind the face when
/// that leaf's mean is this near to the point across the face, in parts of a leaf's side.
constexpr double kSameSurface = 0.2;

/// Parts of a parent's side that coordinates count: a point may lie outside the leaf that it
/// belongs to, by the band above, so 16 bits must reach a little beyond half a side.
constexpr double kUnitsOfParent = 54000.0;

/// Leaves that there is room for. Most parents hold a piece of one surface: three to nine leaves.
constexpr std::array<std::uint32_t, 7> kRoom{2, 4, 6, 9, 14, 20, 27};

constexpr std::size_t kFirstTable = 1024;

/// Vectors that double would be a third empty.
template <typename T>
void grow_for(std::vector<T>& vector, std::size_t more) {
  if (vector.size() + more > vector.capacity()) {
    vector.reserve(vector.size() + std::max<std::size_t>(vector.size() / 8, 256) + more);
  }
}

bool operator==(const VoxelIndex& a, const VoxelIndex& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

/// Place of a leaf among those that there are.
std::uint32_t rank(std::uint32_t occupied, int slot) {
  return static_cast<std::uint32_t>(std::popcount(occupied & ((1U << slot) - 1U)));
}

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
      unit_m_(parent_m_ / kUnitsOfParent),
      table_(kFirstTable, kNoParent) {
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
  const Eigen::Vector3d point_odom_m = point.position().cast<double>();
  const Place place = place_for(point_odom_m);
  Parent& home = parents_[static_cast<std::size_t>(find_or_create(place))];
  const VoxelIndex& inner = place.inner;
  Leaf& leaf = make_leaf(home, slot(inner.x, inner.y, inner.z));
  if (leaf.count >= config_.leaf_capacity) {
    return;
  }
  const bool first = leaf.count == 0;
  leaf_count_ += first ? 1 : 0;
  const std::size_t together = leaf.count + std::size_t{count};
  const double share = static_cast<double>(count) / static_cast<double>(together);
  leaf.count = static_cast<std::uint16_t>(std::min(together, config_.leaf_capacity));
  const Eigen::Vector3d local_m = point_odom_m - centre_of(home);
  const Eigen::Vector3d mean_m = metres(leaf.mean);
  leaf.mean = offset_of(mean_m + share * (local_m - mean_m));
  const Eigen::Vector3d centre_m =
      config_.leaf_m * Eigen::Vector3d(inner.x - 1, inner.y - 1, inner.z - 1);
  if (first || (local_m - centre_m).squaredNorm() < (metres(leaf.point) - centre_m).squaredNorm()) {
    leaf.point = offset_of(local_m);
    leaf.intensity = Eigen::bfloat16(std::isfinite(point.intensity) ? point.intensity : 0.0F);
  }
  if (matters_to_planes(leaf.count, config_.leaf_capacity)) {
    mark_dirty(home, inner, Change::kOfSome);
  }
}

SurfelMap::Offset SurfelMap::offset_of(const Eigen::Vector3d& local_m) const {
  const auto number = [this](double value_m) {
    return static_cast<std::int16_t>(std::lrint(value_m / unit_m_));
  };
  return {number(local_m.x()), number(local_m.y()), number(local_m.z())};
}

SurfelMap::Place SurfelMap::place_of(const VoxelIndex& leaf) const {
  const VoxelIndex home{floor_div3(leaf.x), floor_div3(leaf.y), floor_div3(leaf.z)};
  return {home,
          {leaf.x - kSide * home.x, leaf.y - kSide * home.y, leaf.z - kSide * home.z},
          find(home)};
}

const SurfelMap::Leaf* SurfelMap::leaf_at(const Place& place) const {
  if (place.id == kNoParent) {
    return nullptr;
  }
  const Parent& home = parent(place.id);
  const int i = slot(place.inner.x, place.inner.y, place.inner.z);
  return (home.occupied >> i & 1U) != 0 ? &leaves_[home.first_leaf + rank(home.occupied, i)]
                                        : nullptr;
}

/// The leaf that a point belongs to. Where a surface runs along a face of the leaves, its noise
/// would fill a leaf on either side, both with biased means and of equal weight whatever the share
/// of the points: up to 0.6 sigma of error. So the leaf that was there first keeps the whole
/// surface.
SurfelMap::Place SurfelMap::place_for(const Eigen::Vector3d& point_odom_m) const {
  const Eigen::Vector3d cells = point_odom_m * inverse_leaf_per_m_;
  const VoxelIndex leaf = voxel_index(cells.x(), cells.y(), cells.z(), 1.0);
  const Eigen::Vector3d within = cells - Eigen::Vector3d(leaf.x, leaf.y, leaf.z);
  const Eigen::Array3d to_face = within.array().min(1.0 - within.array());
  const Place place = place_of(leaf);
  if (to_face.minCoeff() > kFaceBand || leaf_at(place) != nullptr) {
    return place;
  }
  for (const Eigen::Index axis : {2, 1, 0}) {
    if (to_face[axis] > kFaceBand) {
      continue;
    }
    VoxelIndex index = leaf;
    (axis == 0 ? index.x : axis == 1 ? index.y : index.z) += within[axis] < 0.5 ? -1 : 1;
    const Place behind = place_of(index);
    const Leaf* there = leaf_at(behind);
    if (there != nullptr && std::abs((centre_of(parent(behind.id)) + metres(there->mean) -
                                      point_odom_m)[axis]) < kSameSurface * config_.leaf_m) {
      return behind;
    }
  }
  return place;
}

/// The leaf, new and empty when there was none.
SurfelMap::Leaf& SurfelMap::make_leaf(Parent& parent, int slot) {
  const std::uint32_t at = rank(parent.occupied, slot);
  if ((parent.occupied >> slot & 1U) == 0) {
    const auto count = static_cast<std::uint32_t>(std::popcount(parent.occupied));
    if (count == 0) {
      move_leaves(parent, 0);
    } else if (count == kRoom[parent.size_class]) {
      move_leaves(parent, static_cast<std::uint8_t>(parent.size_class + 1));
    }
    const auto block = leaves_.begin() + parent.first_leaf;
    std::copy_backward(block + at, block + count, block + count + 1);
    block[at] = {};
    parent.occupied |= 1U << slot;
  }
  return leaves_[parent.first_leaf + at];
}

/// To a block of another size, with what there is.
void SurfelMap::move_leaves(Parent& parent, std::uint8_t size_class) {
  std::vector<std::uint32_t>& free = free_blocks_[size_class];
  auto block = static_cast<std::uint32_t>(leaves_.size());
  if (free.empty()) {
    grow_for(leaves_, kRoom[size_class]);
    leaves_.resize(leaves_.size() + kRoom[size_class]);
  } else {
    block = free.back();
    free.pop_back();
  }
  if (parent.occupied != 0) {
    std::copy_n(leaves_.begin() + parent.first_leaf,
                std::popcount(parent.occupied),
                leaves_.begin() + block);
    free_blocks_[parent.size_class].push_back(parent.first_leaf);
  }
  parent.first_leaf = block;
  parent.size_class = size_class;
}

/// The planes that see this leaf: its own parent's and those of the parents it touches.
void SurfelMap::mark_dirty(const Parent& parent, const VoxelIndex& leaf, Change change) {
  const auto first = [](std::int32_t i) { return i == 0 ? 0 : 1; };
  const auto last = [](std::int32_t i) { return i == kSide - 1 ? 2 : 1; };
  for (int x = first(leaf.x); x <= last(leaf.x); ++x) {
    for (int y = first(leaf.y); y <= last(leaf.y); ++y) {
      for (int z = first(leaf.z); z <= last(leaf.z); ++z) {
        const ParentId id = neighbour(parent, slot(x, y, z));
        if (id == kNoParent) {
          continue;
        }
        Parent& seeing = parents_[static_cast<std::size_t>(id)];
        if (change == Change::kForGood || seeing.changes >= seeing.tolerated) {
          seeing.state = kDirty;
        } else {
          ++seeing.changes;
        }
      }
    }
  }
}

// ---- Parents ---------------------------------------------------------------------------------

SurfelMap::ParentId SurfelMap::find(const VoxelIndex& index) const {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = VoxelKeyHash{}(voxel_key(index)) & mask;
  while (table_[i] != kNoParent && !(parent(table_[i]).index == index)) {
    i = (i + 1) & mask;
  }
  return table_[i];
}

SurfelMap::ParentId SurfelMap::neighbour(const Parent& parent, int direction) const {
  if (direction == kCentre) {
    return static_cast<ParentId>(&parent - parents_.data());
  }
  return (parent.neighbours >> direction & 1U) != 0 ? find(neighbour_index(parent.index, direction))
                                                    : kNoParent;
}

SurfelMap::ParentId SurfelMap::neighbour(const VoxelIndex& home,
                                         ParentId own,
                                         int direction) const {
  return own == kNoParent ? find(neighbour_index(home, direction))
                          : neighbour(parent(own), direction);
}

SurfelMap::ParentId SurfelMap::find_or_create(const Place& place) {
  if (place.id != kNoParent) {
    return place.id;
  }
  const auto id = static_cast<ParentId>(parents_.size());
  grow_for(parents_, 1);
  parents_.emplace_back().index = place.home;
  if (2 * parents_.size() > table_.size()) {
    table_.assign(2 * table_.size(), kNoParent);
    for (ParentId other = 0; other < id; ++other) {
      put_into_table(other);
    }
  }
  put_into_table(id);
  link(id);
  return id;
}

void SurfelMap::put_into_table(ParentId id) {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = VoxelKeyHash{}(voxel_key(parent(id).index)) & mask;
  while (table_[i] != kNoParent) {
    i = (i + 1) & mask;
  }
  table_[i] = id;
}

void SurfelMap::link(ParentId id) {
  Parent& made = parents_[static_cast<std::size_t>(id)];
  for (int d = 0; d < kLeaves; ++d) {
    const ParentId other = d == kCentre ? kNoParent : find(neighbour_index(made.index, d));
    if (other != kNoParent) {
      made.neighbours |= 1U << d;
      parents_[static_cast<std::size_t>(other)].neighbours |= 1U << (kLeaves - 1 - d);
    }
  }
}

void SurfelMap::unlink(const Parent& gone) {
  for (std::uint32_t left = gone.neighbours; left != 0; left &= left - 1) {
    const int d = std::countr_zero(left);
    const ParentId other = find(neighbour_index(gone.index, d));
    parents_[static_cast<std::size_t>(other)].neighbours &= ~(1U << (kLeaves - 1 - d));
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
  const auto block = leaves_.begin() + parent.first_leaf;
  auto kept = block;
  auto leaf = block;
  const std::uint32_t before = parent.occupied;
  for (std::uint32_t left = before; left != 0; left &= left - 1, ++leaf) {
    const int i = std::countr_zero(left);
    if ((origin + metres(leaf->mean)).cwiseAbs().maxCoeff() <= half_side_m) {
      *kept++ = *leaf;
    } else {
      parent.occupied &= ~(1U << i);
      --leaf_count_;
      mark_dirty(parent, {i / 9, i / 3 % 3, i % 3}, Change::kForGood);
    }
  }
  if (parent.occupied == 0 && before != 0) {
    free_blocks_[parent.size_class].push_back(parent.first_leaf);
  }
}

/// Closes the gaps without changing the order of what stays.
void SurfelMap::erase_empty_parents() {
  for (const Parent& gone : parents_) {
    if (gone.occupied == 0) {
      unlink(gone);
    }
  }
  std::erase_if(parents_, [](const Parent& parent) { return parent.occupied == 0; });
  std::fill(table_.begin(), table_.end(), kNoParent);
  for (std::size_t id = 0; id < parents_.size(); ++id) {
    put_into_table(static_cast<ParentId>(id));
  }
}

// ---- Laying anew -----------------------------------------------------------------------------

void SurfelMap::clear() {
  parents_.clear();
  leaves_.clear();
  for (std::vector<std::uint32_t>& blocks : free_blocks_) {
    blocks.clear();
  }
  std::fill(table_.begin(), table_.end(), kNoParent);
  leaf_count_ = 0;
}

void SurfelMap::transform(const Pose& T_new_old) {
  const std::vector<Parent> old = std::exchange(parents_, {});
  const std::vector<Leaf> leaves = std::exchange(leaves_, {});
  clear();
  for (const Parent& parent : old) {
    const Eigen::Vector3d centre = centre_of(parent);
    for (int i = 0; i < std::popcount(parent.occupied); ++i) {
      const Leaf& leaf = leaves[parent.first_leaf + static_cast<std::uint32_t>(i)];
      const Eigen::Vector3f p = (T_new_old * (centre + metres(leaf.mean))).cast<float>();
      if (voxel_index_fits(p.x(), p.y(), p.z(), inverse_leaf_per_m_)) {
        insert_mean({p.x(), p.y(), p.z(), static_cast<float>(leaf.intensity)}, leaf.count);
      }
    }
  }
}

void SurfelMap::rebuild(const PointCloud& points_odom) {
  clear();
  insert(points_odom);
}

std::size_t SurfelMap::memory_bytes() const {
  std::size_t free = 0;
  for (const std::vector<std::uint32_t>& blocks : free_blocks_) {
    free += blocks.capacity() * sizeof(std::uint32_t);
  }
  return parents_.capacity() * sizeof(Parent) + leaves_.capacity() * sizeof(Leaf) +
         table_.capacity() * sizeof(ParentId) + free;
}

PointCloud SurfelMap::points() const {
  PointCloud cloud;
  cloud.reserve(leaf_count_);
  for (const Parent& parent : parents_) {
    const Eigen::Vector3d centre = centre_of(parent);
    for (const Leaf& leaf : leaves_of(parent)) {
      const Eigen::Vector3f p = (centre + metres(leaf.mean)).cast<float>();
      cloud.push_back({p.x(), p.y(), p.z(), static_cast<float>(leaf.intensity)});
    }
  }
  return cloud;
}

std::unique_ptr<LocalMap> make_surfel_map(const SurfelMapConfig& config) {
  return std::make_unique<SurfelMap>(config);
}

}  // namespace trigpoint::lio_mapper
