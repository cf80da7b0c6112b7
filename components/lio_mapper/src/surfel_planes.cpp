// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Planes of the surfel map: how they are fitted and found.
#include "surfel_grid.hpp"
#include "surfel_map.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace trigpoint::lio_mapper {

using surfel_grid::kSide;
using surfel_grid::neighbour_index;
using surfel_grid::slot;

namespace {

/// A plane needs this many leaves, of which this many in the parent itself.
constexpr int kMinLeaves = 5;
constexpr int kMinOwnLeaves = 3;

/// A query nearer than this to a face, in parts of a parent's side, also looks behind the face
/// (0.4 m of 1.5 m).
constexpr double kFaceReach = 0.4 / 1.5;

/// A plane is a surface when this share of the points near it lie on it; foliage of a crown has
/// less than half.
constexpr double kOnPlane_m = 0.1;
constexpr double kSurfaceShare = 0.95;

/// Of two planes that both explain a point, the distance to the plane counts this much more than
/// the distance along it: else a point beside a corner may be given to the wall it does not lie on.
constexpr double kAcrossWeight2 = 9.0;

/// Where no plane holds: the farthest of the nearest points within so many sides of a leaf, and
/// none farther from their plane.
constexpr double kNearestReach = 3.0;  // as far as the neighbouring parents surely hold them all
constexpr double kNearestPlane_m = 0.1;

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

}  // namespace

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
      plane.tilt2_rad2 = static_cast<double>(found->tilt2_rad2);
    }
  }
  return std::isfinite(least_cost) ||
         (config_.nearest_points && match_nearest_points(point_odom_m, plane));
}

/// Offsets from a query, nearest first.
void SurfelMap::offer_points(const Parent& parent,
                             const Eigen::Vector3d& point_odom_m,
                             NearestPoints& nearest) const {
  const Eigen::Vector3d origin = centre_of(parent) - point_odom_m;
  const double beyond_m = (origin.cwiseAbs().array() - 0.5 * parent_m_).max(0.0).matrix().norm();
  if (beyond_m * beyond_m > nearest.back().distance2_m2) {
    return;
  }
  for (std::uint32_t left = parent.occupied; left != 0; left &= left - 1) {
    const auto leaf = static_cast<std::size_t>(std::countr_zero(left));
    NearPoint candidate{0.0, origin + local(parent.points[leaf])};
    candidate.distance2_m2 = candidate.offset_m.squaredNorm();
    for (NearPoint& place : nearest) {
      if (candidate.distance2_m2 < place.distance2_m2) {
        std::swap(candidate, place);
      }
    }
  }
}

/// Where no plane holds, as in foliage: FAST-LIO2's plane through the five nearest points, of those
/// that the leaves keep. Their means would not do: in a crown they lie at the leaves' centres and
/// tell nothing of its shape.
bool SurfelMap::match_nearest_points(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const {
  const Eigen::Vector3d cells = point_odom_m * inverse_parent_per_m_;
  const VoxelIndex home = voxel_index(cells.x(), cells.y(), cells.z(), 1.0);
  const ParentId own = find(home);
  NearestPoints nearest{};
  for (int direction = 0; direction < kLeaves; ++direction) {
    const ParentId id = own == kNoParent ? find(neighbour_index(home, direction))
                                         : parents_[static_cast<std::size_t>(own)]
                                               .neighbours[static_cast<std::size_t>(direction)];
    if (id != kNoParent) {
      offer_points(parents_[static_cast<std::size_t>(id)], point_odom_m, nearest);
    }
  }
  const double farthest_m = kNearestReach * config_.leaf_m;
  if (!(nearest.back().distance2_m2 < farthest_m * farthest_m)) {
    return false;
  }
  std::array<Eigen::Vector3d, kNearestPoints> points;
  std::transform(nearest.begin(), nearest.end(), points.begin(), [](const NearPoint& near) {
    return near.offset_m;
  });
  const auto fit = fit_neighbours(points, kNearestPlane_m);
  if (!fit || std::abs(fit->normal.dot(fit->centroid)) > config_.max_residual_m) {
    return false;
  }
  plane.normal = fit->normal;
  plane.offset_m = -fit->normal.dot(fit->centroid + point_odom_m);
  plane.thickness2_m2 = thickness2_of_neighbours_m2(*fit, points.size());
  plane.tilt2_rad2 = tilt2_rad2(*fit, plane.thickness2_m2, kNearestPoints);
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
    stored.tilt2_rad2 = scratch.tilt2_rad2;
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
  const auto plane = plane_of(window_of(parent));
  if (plane && is_surface(parent, *plane)) {
    result.normal = plane->normal;
    result.centroid_odom_m = plane->centroid + centre_of(parent);
    result.thickness2_m2 = plane->eigenvalues[0] + kThicknessFloor2_m2;
    result.tilt2_rad2 = static_cast<float>(tilt2_rad2(*plane, result.thickness2_m2, kMinLeaves));
    result.state = kPlane;
  }
  return result;
}

/// Leaf means are smoother than what they are means of: in a crown some always lie on a plane by
/// chance, and points that match it would only confirm the prediction. Single points tell.
bool SurfelMap::is_surface(const Parent& parent, const PlaneFit& plane) const {
  int on_plane = 0;
  for (std::uint32_t left = parent.occupied; left != 0; left &= left - 1) {
    const auto leaf = static_cast<std::size_t>(std::countr_zero(left));
    const double distance_m = plane.normal.dot(local(parent.points[leaf]) - plane.centroid);
    on_plane += std::abs(distance_m) < kOnPlane_m ? 1 : 0;
  }
  return on_plane >= kSurfaceShare * std::popcount(parent.occupied);
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

}  // namespace trigpoint::lio_mapper
