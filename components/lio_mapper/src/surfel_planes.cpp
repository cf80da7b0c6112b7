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

using surfel_grid::kFaceBand;
using surfel_grid::kSide;
using surfel_grid::slot;

namespace {

/// A plane needs this many leaves, of which this many in the parent itself.
constexpr int kMinLeaves = 5;
constexpr int kMinOwnLeaves = 3;

/// A plane is fitted again after one change for so many leaves that it saw.
constexpr int kLeavesPerChange = 8;

/// A query nearer than this to a face, in parts of a parent's side, also looks behind the face
/// (0.4 m of 1.5 m).
constexpr double kFaceReach = 0.4 / 1.5;

/// A plane is a surface when this share of the points near it lie on it; foliage of a crown has
/// less than half.
constexpr double kOnPlane_m = 0.1;
constexpr double kSurfaceShare = 0.75;

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

/// The 27 directions: itself, behind the faces, the edges, the corners.
constexpr std::array<int, 27> kNearestFirst{13, 4,  10, 12, 14, 16, 22, 1, 3, 5,  7,  9,  11, 15,
                                            17, 19, 21, 23, 25, 0,  2,  6, 8, 18, 20, 24, 26};

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

/// Which neighbour a query looks into as well: -1, 0 or 1; `within` in parts of a parent's side.
constexpr int near_face(double within) {
  return within < kFaceReach ? -1 : (within > 1.0 - kFaceReach ? 1 : 0);
}

}  // namespace

/// Asks the parent that holds the point, and those behind the faces that are near.
bool SurfelMap::match_surface(const Eigen::Vector3d& point_odom_m, PlaneMatch& match) const {
  if (!voxel_index_fits(
          point_odom_m.x(), point_odom_m.y(), point_odom_m.z(), inverse_leaf_per_m_)) {
    return false;
  }
  const Eigen::Vector3d cells = point_odom_m * inverse_parent_per_m_;
  const VoxelIndex home = voxel_index(cells.x(), cells.y(), cells.z(), 1.0);
  const std::array<int, 3> behind{
      near_face(cells.x() - home.x), near_face(cells.y() - home.y), near_face(cells.z() - home.z)};
  const ParentId own = find(home);
  double least_cost = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 8; ++i) {
    const std::array<int, 3> step{
        (i & 4) != 0 ? behind[0] : 0, (i & 2) != 0 ? behind[1] : 0, (i & 1) != 0 ? behind[2] : 0};
    const bool repeated = ((i & 4) != 0 && step[0] == 0) || ((i & 2) != 0 && step[1] == 0) ||
                          ((i & 1) != 0 && step[2] == 0);
    if (repeated) {
      continue;
    }
    const int direction = slot(step[0] + 1, step[1] + 1, step[2] + 1);
    const ParentId id = neighbour(home, own, direction);
    const auto plane = id == kNoParent ? std::nullopt : plane_of(id);
    if (!plane) {
      continue;
    }
    const Eigen::Vector3d normal = plane->normal.cast<double>();
    const Eigen::Vector3d centroid = centre_of(parent(id)) + plane->centroid_m.cast<double>();
    const Eigen::Vector3d offset = point_odom_m - centroid;
    const double residual = normal.dot(offset);
    const double cost = offset.squaredNorm() + (kAcrossWeight2 - 1.0) * residual * residual;
    if (std::abs(residual) < config_.max_residual_m && cost < least_cost) {
      least_cost = cost;
      match.normal = normal;
      match.offset_m = -normal.dot(centroid);
      match.thickness2_m2 = static_cast<double>(plane->thickness2_m2);
      match.tilt2_rad2 = static_cast<double>(plane->tilt2_rad2);
      if (i == 0 && std::abs(residual) < kOnPlane_m) {
        return true;  // surely its own surface: no other has to be looked for
      }
    }
  }
  return std::isfinite(least_cost);
}

/// Offsets from a query, nearest first.
void SurfelMap::offer_points(const Parent& parent,
                             const Eigen::Vector3d& point_odom_m,
                             NearestPoints& nearest) const {
  const Eigen::Vector3d origin = centre_of(parent) - point_odom_m;
  for (const Leaf& leaf : leaves_of(parent)) {
    NearPoint candidate{0.0, origin + metres(leaf.point)};
    candidate.distance2_m2 = candidate.offset_m.squaredNorm();
    if (!(candidate.distance2_m2 < nearest.back().distance2_m2)) {
      continue;
    }
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
bool SurfelMap::match_nearest(const Eigen::Vector3d& point_odom_m, PlaneMatch& plane) const {
  if (!config_.nearest_points ||
      !voxel_index_fits(
          point_odom_m.x(), point_odom_m.y(), point_odom_m.z(), inverse_leaf_per_m_)) {
    return false;
  }
  const Eigen::Vector3d cells = point_odom_m * inverse_parent_per_m_;
  const VoxelIndex home = voxel_index(cells.x(), cells.y(), cells.z(), 1.0);
  const ParentId own = find(home);
  // Squared distances along each axis to the parents before, at and behind the query.
  const Eigen::Array3d within_m =
      parent_m_ * (cells.array() - Eigen::Array3d(home.x, home.y, home.z));
  Eigen::Array33d beyond2_m2 = Eigen::Array33d::Zero();
  beyond2_m2.col(0) = (within_m - kFaceBand * config_.leaf_m).max(0.0).square();
  beyond2_m2.col(2) = (parent_m_ - within_m - kFaceBand * config_.leaf_m).max(0.0).square();
  const double farthest_m = kNearestReach * config_.leaf_m;
  NearestPoints nearest{};
  nearest.fill({farthest_m * farthest_m, Eigen::Vector3d::Zero()});
  for (const int direction : kNearestFirst) {
    if (beyond2_m2(0, direction / 9) + beyond2_m2(1, direction / 3 % 3) +
            beyond2_m2(2, direction % 3) >=
        nearest.back().distance2_m2) {
      continue;
    }
    const ParentId id = neighbour(home, own, direction);
    if (id != kNoParent) {
      offer_points(parent(id), point_odom_m, nearest);
    }
  }
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

/// Nothing where no plane holds. A thread that finds a plane out of date fits it for itself; the
/// first one also stores it. All compute the same bits, so nobody has to wait.
std::optional<SurfelMap::Plane> SurfelMap::plane_of(ParentId id) const {
  Parent& asked = parents_[static_cast<std::size_t>(id)];
  const std::atomic_ref<std::uint32_t> state(asked.state);
  std::uint32_t seen = state.load(std::memory_order_acquire);
  if (seen == kPlane) {
    return asked.plane;
  }
  if (seen == kNoPlane) {
    return std::nullopt;
  }
  int leaves = 0;
  const std::optional<Plane> plane = fit(asked, leaves);
  seen = kDirty;
  if (state.compare_exchange_strong(seen, kFitting, std::memory_order_acquire)) {
    asked.plane = plane.value_or(Plane{});
    asked.changes = 0;
    asked.tolerated = static_cast<std::uint8_t>(leaves / kLeavesPerChange);
    state.store(plane ? kPlane : kNoPlane, std::memory_order_release);
  }
  return plane;
}

/// `leaves`: that it saw.
std::optional<SurfelMap::Plane> SurfelMap::fit(const Parent& parent, int& leaves) const {
  if (std::popcount(parent.occupied) < kMinOwnLeaves) {
    return std::nullopt;
  }
  const Window window = window_of(parent);
  leaves = window.all().count;
  const auto fitted = flat_fit(window);
  if (!fitted || !is_surface(parent, *fitted)) {
    return std::nullopt;
  }
  const double thickness2_m2 = fitted->eigenvalues[0] + kThicknessFloor2_m2;
  return Plane{fitted->normal.cast<float>(),
               fitted->centroid.cast<float>(),
               static_cast<float>(thickness2_m2),
               static_cast<float>(tilt2_rad2(*fitted, thickness2_m2, kMinLeaves))};
}

/// Leaf means are smoother than what they are means of: in a crown some always lie on a plane by
/// chance, and points that match it would only confirm the prediction. Single points tell.
bool SurfelMap::is_surface(const Parent& parent, const PlaneFit& plane) const {
  int on_plane = 0;
  for (const Leaf& leaf : leaves_of(parent)) {
    const double distance_m = plane.normal.dot(metres(leaf.point) - plane.centroid);
    on_plane += std::abs(distance_m) < kOnPlane_m ? 1 : 0;
  }
  return on_plane >= kSurfaceShare * std::popcount(parent.occupied);
}

SurfelMap::Window SurfelMap::window_of(const Parent& parent) const {
  Window window;
  for (std::uint32_t around = parent.neighbours | 1U << kCentre; around != 0;
       around &= around - 1) {
    const int d = std::countr_zero(around);
    const Parent& other = this->parent(neighbour(parent, d));
    const Eigen::Index axis = axis_of_face(d);
    Moments& group = d == kCentre ? window.own
                     : axis >= 0  ? window.slabs[static_cast<std::size_t>(axis)]
                                  : window.corners;
    const Eigen::Vector3d shift = parent_m_ * Eigen::Vector3d(d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1);
    for (std::uint32_t left = other.occupied & kTouching[static_cast<std::size_t>(d)]; left != 0;
         left &= left - 1) {
      const auto before =
          static_cast<std::uint32_t>(std::popcount(other.occupied & ((left & (0U - left)) - 1U)));
      group.add(metres(leaves_[other.first_leaf + before].mean) + shift);
    }
  }
  return window;
}

/// The widest window that is flat. Where a wall stands on the ground the whole one is not, but the
/// parent with the leaves behind one pair of its faces may be.
std::optional<PlaneFit> SurfelMap::flat_fit(const Window& window) const {
  if (auto plane = flat_fit(window.all())) {
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
