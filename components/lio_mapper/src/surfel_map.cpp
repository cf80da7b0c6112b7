// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "surfel_map.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

namespace trigpoint::lio_mapper {
namespace {

constexpr int kSide = 3;  // leaves along a parent

/// A plane needs this many leaves, of which this many in the parent itself.
constexpr int kMinLeaves = 5;
constexpr int kMinOwnLeaves = 3;

/// A query nearer than this to a face, in parts of a parent's side, also looks behind the face
/// (0.4 m of 1.5 m).
constexpr double kFaceReach = 0.4 / 1.5;

/// Of two planes that both explain a point, the distance to the plane counts this much more than
/// the distance along it: else a point beside a corner may be given to the wall it does not lie on.
constexpr double kAcrossWeight2 = 9.0;

/// A point nearer than this to the face of an empty leaf may belong to the leaf behind the face, in
/// parts of a leaf's side (5 cm of 0.5 m: 2.5 sigma of a LiDAR's range noise), ...
constexpr double kFaceBand = 0.1;
/// ... namely when that leaf's mean is this near to the point across the face.
constexpr double kSameSurface = 0.2;

/// Where no plane holds: this many leaf means, the farthest within so many sides of a leaf.
constexpr int kNearestLeaves = 5;
constexpr double kNearestLeafReach = 2.0;

/// (5 mm)^2: no LiDAR knows a surface better, however well the means agree.
constexpr double kThicknessFloor2_m2 = 2.5e-5;

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

constexpr int slot(int x, int y, int z) {
  return (x * kSide + y) * kSide + z;
}

/// For each of the 27 directions: the leaves of that neighbour which touch the parent in the
/// middle.
constexpr std::array<std::uint32_t, 27> touching_leaves() {
  const auto touches = [](int direction, int leaf) {
    return direction == 0 || (direction < 0 ? leaf == kSide - 1 : leaf == 0);
  };
  std::array<std::uint32_t, 27> masks{};
  for (int d = 0; d < 27; ++d) {
    for (int l = 0; l < 27; ++l) {
      const bool touching = touches(d / 9 - 1, l / 9) && touches(d / 3 % 3 - 1, l / 3 % 3) &&
                            touches(d % 3 - 1, l % 3);
      masks[static_cast<std::size_t>(d)] |= (touching ? 1U : 0U) << l;
    }
  }
  return masks;
}

constexpr std::array<std::uint32_t, 27> kTouching = touching_leaves();

constexpr Eigen::Index axis_of_face(int direction) {
  switch (direction) {
    case slot(0, 1, 1):
    case slot(2, 1, 1):
      return 0;
    case slot(1, 0, 1):
    case slot(1, 2, 1):
      return 1;
    case slot(1, 1, 0):
    case slot(1, 1, 2):
      return 2;
    default:
      return -1;
  }
}

std::int32_t floor_div3(std::int32_t i) {
  return (i >= 0 ? i : i - (kSide - 1)) / kSide;
}

VoxelIndex neighbour_index(const VoxelIndex& index, int direction) {
  return {
      index.x + direction / 9 - 1, index.y + direction / 3 % 3 - 1, index.z + direction % 3 - 1};
}

}  // namespace

SurfelMap::SurfelMap(const SurfelMapConfig& config)
    : config_(config),
      inverse_leaf_per_m_(1.0 / config.leaf_m),
      parent_m_(kSide * config.leaf_m),
      inverse_parent_per_m_(1.0 / parent_m_) {
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
  leaf_count_ += parent.counts[i] == 0 ? 1 : 0;
  parent.occupied |= 1U << i;
  parent.counts[i] = static_cast<std::uint16_t>(
      std::min<std::size_t>(parent.counts[i] + std::size_t{count}, config_.leaf_capacity));
  const float share =
      static_cast<float>(std::min(count, parent.counts[i])) / static_cast<float>(parent.counts[i]);
  const Eigen::Vector3f local = (point.position().cast<double>() - centre_of(parent)).cast<float>();
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

// ---- Matching --------------------------------------------------------------------------------

bool SurfelMap::match(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const {
  if (!voxel_index_fits(
          point_odom_m.x(), point_odom_m.y(), point_odom_m.z(), inverse_leaf_per_m_)) {
    return false;
  }
  double least_cost = std::numeric_limits<double>::infinity();
  Surfel scratch;
  const std::array<ParentId, 8> parents = candidates(point_odom_m);
  for (const ParentId id : parents) {
    const Surfel* found = id == kNoParent ? nullptr : surfel(id, scratch);
    if (found == nullptr) {
      continue;
    }
    const Eigen::Vector3d offset = point_odom_m - found->centroid_odom_m;
    const double residual = found->normal.dot(offset);
    const double cost = offset.squaredNorm() + (kAcrossWeight2 - 1.0) * residual * residual;
    if (std::abs(residual) < config_.max_residual_m && cost < least_cost) {
      least_cost = cost;
      plane.normal = found->normal;
      plane.offset_m = -found->normal.dot(found->centroid_odom_m);
      plane.thickness2_m2 = found->thickness2_m2;
    }
  }
  return std::isfinite(least_cost) ||
         (config_.nearest_leaves && match_nearest_leaves(point_odom_m, parents, plane));
}

/// Where no plane holds, as in foliage, the five nearest leaf means tell at least where most of it
/// is. What they say counts as little as they are thick.
bool SurfelMap::match_nearest_leaves(const Eigen::Vector3d& point_odom_m,
                                     const std::array<ParentId, 8>& parents,
                                     PlaneMatch& plane) const {
  struct Near {
    double distance2_m2{std::numeric_limits<double>::infinity()};
    Eigen::Vector3d offset_m{Eigen::Vector3d::Zero()};  ///< from the point
  };

  std::array<Near, kNearestLeaves> nearest{};
  for (const ParentId id : parents) {
    if (id == kNoParent) {
      continue;
    }
    const Parent& parent = parents_[static_cast<std::size_t>(id)];
    const Eigen::Vector3d origin = centre_of(parent) - point_odom_m;
    for (std::uint32_t left = parent.occupied; left != 0; left &= left - 1) {
      const LeafMean& mean = parent.means[static_cast<std::size_t>(std::countr_zero(left))];
      Near candidate{0.0, origin + Eigen::Vector3d(mean.x, mean.y, mean.z)};
      candidate.distance2_m2 = candidate.offset_m.squaredNorm();
      for (Near& slot : nearest) {
        if (candidate.distance2_m2 < slot.distance2_m2) {
          std::swap(candidate, slot);
        }
      }
    }
  }
  const double farthest_m = kNearestLeafReach * config_.leaf_m;
  if (!(nearest.back().distance2_m2 < farthest_m * farthest_m)) {
    return false;
  }
  Moments moments;
  for (const Near& near : nearest) {
    moments.add(near.offset_m);
  }
  const auto fit = fit_plane(moments);
  if (!fit || fit->linearity() < config_.min_linearity ||
      std::abs(fit->normal.dot(fit->centroid)) > config_.max_residual_m) {
    return false;
  }
  plane.normal = fit->normal;
  plane.offset_m = -fit->normal.dot(fit->centroid + point_odom_m);
  // Three degrees of freedom of the five went into the plane.
  plane.thickness2_m2 =
      fit->eigenvalues[0] * kNearestLeaves / (kNearestLeaves - 3) + kThicknessFloor2_m2;
  return true;
}

/// The parent that holds the point, and those behind the faces that are near; kNoParent fills up.
std::array<SurfelMap::ParentId, 8> SurfelMap::candidates(const Eigen::Vector3d& point) const {
  const auto side = [](double cells, std::int32_t index) {
    const double within = cells - index;
    return within < kFaceReach ? -1 : (within > 1.0 - kFaceReach ? 1 : 0);
  };
  const Eigen::Vector3d cells = point * inverse_parent_per_m_;
  const VoxelIndex home = voxel_index(cells.x(), cells.y(), cells.z(), 1.0);
  const int dx = side(cells.x(), home.x);
  const int dy = side(cells.y(), home.y);
  const int dz = side(cells.z(), home.z);
  const ParentId own = find(home);

  std::array<ParentId, 8> ids{};
  ids.fill(kNoParent);
  for (int i = 0; i < 8; ++i) {
    const int x = (i & 4) != 0 ? dx : 0;
    const int y = (i & 2) != 0 ? dy : 0;
    const int z = (i & 1) != 0 ? dz : 0;
    const bool repeated =
        ((i & 4) != 0 && dx == 0) || ((i & 2) != 0 && dy == 0) || ((i & 1) != 0 && dz == 0);
    if (repeated) {
      continue;
    }
    const int direction = slot(x + 1, y + 1, z + 1);
    ids[static_cast<std::size_t>(i)] = own == kNoParent
                                           ? find(neighbour_index(home, direction))
                                           : parents_[static_cast<std::size_t>(own)]
                                                 .neighbours[static_cast<std::size_t>(direction)];
  }
  return ids;
}

/// Null where no plane holds. A thread that finds a plane out of date fits it for itself; the first
/// one also stores it. All compute the same bits, so nobody has to wait.
const SurfelMap::Surfel* SurfelMap::surfel(ParentId id, Surfel& scratch) const {
  Surfel& stored = surfels_[static_cast<std::size_t>(id)];
  const std::atomic_ref<std::uint32_t> state(stored.state);
  std::uint32_t seen = state.load(std::memory_order_acquire);
  if (seen == kPlane || seen == kNoPlane) {
    return seen == kPlane ? &stored : nullptr;
  }
  scratch = fit(parents_[static_cast<std::size_t>(id)]);
  const std::uint32_t result = scratch.state;
  seen = kDirty;
  if (state.compare_exchange_strong(seen, kFitting, std::memory_order_acquire)) {
    stored.normal = scratch.normal;
    stored.centroid_odom_m = scratch.centroid_odom_m;
    stored.thickness2_m2 = scratch.thickness2_m2;
    state.store(result, std::memory_order_release);
  }
  return result == kPlane ? &scratch : nullptr;
}

SurfelMap::Surfel SurfelMap::fit(const Parent& parent) const {
  Surfel result;
  result.state = kNoPlane;
  if (std::popcount(parent.occupied) < kMinOwnLeaves) {
    return result;
  }
  if (const auto plane = plane_of(window_of(parent))) {
    result.normal = plane->normal;
    result.centroid_odom_m = plane->centroid + centre_of(parent);
    result.thickness2_m2 = plane->eigenvalues[0] + kThicknessFloor2_m2;
    result.state = kPlane;
  }
  return result;
}

SurfelMap::Window SurfelMap::window_of(const Parent& parent) const {
  Window window;
  for (int d = 0; d < kLeaves; ++d) {
    const ParentId id = parent.neighbours[static_cast<std::size_t>(d)];
    if (id == kNoParent) {
      continue;
    }
    const Parent& other = parents_[static_cast<std::size_t>(id)];
    const Eigen::Index axis = axis_of_face(d);
    Moments& group = d == kCentre ? window.own
                     : axis >= 0  ? window.slabs[static_cast<std::size_t>(axis)]
                                  : window.corners;
    const Eigen::Vector3d shift = parent_m_ * Eigen::Vector3d(d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1);
    for (std::uint32_t left = other.occupied & kTouching[static_cast<std::size_t>(d)]; left != 0;
         left &= left - 1) {
      const LeafMean& mean = other.means[static_cast<std::size_t>(std::countr_zero(left))];
      group.add(Eigen::Vector3d(mean.x, mean.y, mean.z) + shift);
    }
  }
  return window;
}

/// The widest window that is flat. Where a wall stands on the ground the whole one is not, but the
/// parent with the leaves behind one pair of its faces may be.
std::optional<PlaneFit> SurfelMap::plane_of(const Window& window) const {
  Moments all = window.own;
  all += window.corners;
  for (const Moments& slab : window.slabs) {
    all += slab;
  }
  if (auto plane = flat_fit(all)) {
    return plane;
  }
  std::optional<PlaneFit> flattest;
  for (const Moments& slab : window.slabs) {
    Moments extended = window.own;
    extended += slab;
    const auto plane = slab.count > 0 ? flat_fit(extended) : std::nullopt;
    if (plane && (!flattest || plane->flatness() < flattest->flatness())) {
      flattest = plane;
    }
  }
  return flattest ? flattest : flat_fit(window.own);
}

std::optional<PlaneFit> SurfelMap::flat_fit(const Moments& moments) const {
  if (moments.count < kMinLeaves) {
    return std::nullopt;
  }
  auto plane = fit_plane(moments);
  if (!plane || plane->flatness() > config_.max_flatness ||
      plane->linearity() < config_.min_linearity) {
    return std::nullopt;
  }
  return plane;
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
