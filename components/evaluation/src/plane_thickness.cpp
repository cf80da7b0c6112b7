// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/plane_thickness.hpp"

#include "facades.hpp"
#include "place_hash.hpp"
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <vector>

namespace trigpoint::evaluation {

namespace {

using Eigen::Vector3d;

constexpr double kCell_m = 2.0;
/// A cell also sees the points this far outside (in x and y), so that no border cuts a wall along
/// its face.
constexpr double kPlaneMargin_m = 0.5;
/// A point counts as upright when its column of this side reaches kColumnHeight_m in the cell:
/// ground, roofs and bonnets do not.
constexpr double kColumn_m = 0.2;
constexpr double kColumnHeight_m = 0.5;
constexpr int kTrials = 60;
constexpr int kMostFits = 20;
/// Two points nearer than this do not tell a wall's direction.
constexpr double kLeastBase_m = 0.5;
/// Of points that the plane is fitted to; beyond it lies what makes the wall thick.
constexpr double kInlier_m = 0.1;
/// What lies further away is something else.
constexpr double kWindow_m = 0.4;
constexpr std::size_t kLeastPoints = 100;
/// Of the points within the window, inliers must be at least this share. They are half of two equal
/// copies of a wall, but a quarter of clutter that fills the window evenly.
constexpr double kLeastInliers = 0.45;
constexpr double kMostTilt = 0.17;  // |n_z|: 10 degrees
constexpr double kLeastLength_m = 1.0;
constexpr double kLeastHeight_m = 1.5;
/// Between these ranks lies +-1 sigma of a normal distribution.
constexpr double kLowRank = 0.158655;
constexpr double kHighRank = 0.841345;

using CellKey = FacadeCell;
using PlanePoints = std::vector<Vector3d>;

std::int32_t index_of(double x_m, double side_m) {
  return static_cast<std::int32_t>(std::floor(x_m / side_m));
}

/// The given rank of unsorted values, which are reordered.
double at_rank(std::vector<double>& values, double rank) {
  const auto at = values.begin() +
                  static_cast<std::ptrdiff_t>(rank * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::map<CellKey, PlanePoints> fill_cells(const PointCloud& cloud, double share) {
  constexpr double kFar_m = 1e7;  // an index of that size still fits
  std::map<CellKey, PlanePoints> cells;
  for (const PointXyzi& point : cloud) {
    const Vector3d p = point.position().cast<double>();
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > kFar_m) {
      continue;
    }
    const std::int32_t k = index_of(p.z(), kCell_m);
    for (std::int32_t i = index_of(p.x() - kPlaneMargin_m, kCell_m);
         i <= index_of(p.x() + kPlaneMargin_m, kCell_m);
         ++i) {
      for (std::int32_t j = index_of(p.y() - kPlaneMargin_m, kCell_m);
           j <= index_of(p.y() + kPlaneMargin_m, kCell_m);
           ++j) {
        const CellKey key{i, j, k};
        if (is_drawn(key, share)) {
          cells[key].push_back(p);
        }
      }
    }
  }
  return cells;
}

/// Only points that stand above or below others.
PlanePoints upright(const PlanePoints& points) {
  struct HeightRange {
    double lowest_m{1e9};
    double highest_m{-1e9};
  };

  const auto column_of = [](const Vector3d& p) {
    return std::array{index_of(p.x(), kColumn_m), index_of(p.y(), kColumn_m)};
  };
  std::map<std::array<std::int32_t, 2>, HeightRange> columns;
  for (const Vector3d& p : points) {
    HeightRange& range = columns[column_of(p)];
    range.lowest_m = std::min(range.lowest_m, p.z());
    range.highest_m = std::max(range.highest_m, p.z());
  }
  PlanePoints kept;
  std::copy_if(points.begin(), points.end(), std::back_inserter(kept), [&](const Vector3d& p) {
    const HeightRange& range = columns[column_of(p)];
    return range.highest_m - range.lowest_m >= kColumnHeight_m;
  });
  return kept;
}

using Plane = Facade;

PlanePoints near_to(const Plane& plane, const PlanePoints& points, double distance_m) {
  PlanePoints near;
  std::copy_if(points.begin(), points.end(), std::back_inserter(near), [&](const Vector3d& p) {
    return std::abs(plane.distance_m(p)) <= distance_m;
  });
  return near;
}

/// The vertical plane through two of the points that has most of them near it; a point counts by
/// 1 - (d / kInlier_m)^2 (MSAC, P. Torr, A. Zisserman, CVIU 78(1), 2000), so that a plane askew
/// between two copies of a wall does not win against one of them.
std::optional<Plane> vote(const PlanePoints& points) {
  std::mt19937 random(1);  // seeded alike for every cell: its result depends on its points only
  std::optional<Plane> best;
  double most = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Vector3d& a = points[random() % points.size()];
    const Vector3d& b = points[random() % points.size()];
    const Vector3d along = (b - a).cwiseProduct(Vector3d(1.0, 1.0, 0.0));
    if (along.norm() < kLeastBase_m) {
      continue;
    }
    const Plane plane{along.cross(Vector3d::UnitZ()).normalized(), a};
    double votes = 0.0;
    for (const Vector3d& p : points) {
      const double d = plane.distance_m(p) / kInlier_m;
      votes += std::max(0.0, 1.0 - d * d);
    }
    if (votes > most) {
      most = votes;
      best = plane;
    }
  }
  return best;
}

Plane fit(const PlanePoints& points) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : points) {
    mean += p / static_cast<double>(points.size());
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Vector3d& p : points) {
    scatter += (p - mean) * (p - mean).transpose();
  }
  return {Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0), mean};
}

/// The plane of its own inliers, from the best vote on.
std::optional<Plane> find_plane(const PlanePoints& points) {
  std::optional<Plane> plane = vote(points);
  std::size_t before = 0;
  for (int i = 0; plane && i < kMostFits; ++i) {
    const PlanePoints inliers = near_to(*plane, points, kInlier_m);
    if (inliers.size() < 3) {
      return std::nullopt;
    }
    if (inliers.size() == before) {
      break;
    }
    before = inliers.size();
    plane = fit(inliers);
  }
  return plane;
}

/// Between the 5th and the 95th of a hundred points, along `direction`.
double extent_m(const PlanePoints& points, const Vector3d& direction) {
  std::vector<double> along;
  std::transform(points.begin(), points.end(), std::back_inserter(along), [&](const Vector3d& p) {
    return direction.dot(p);
  });
  const double low = at_rank(along, 0.05);
  return at_rank(along, 0.95) - low;
}

bool is_facade(const Plane& plane, const PlanePoints& inliers, const PlanePoints& window) {
  const Vector3d along = plane.normal.cross(Vector3d::UnitZ()).normalized();
  return window.size() >= kLeastPoints && std::abs(plane.normal.z()) <= kMostTilt &&
         static_cast<double>(inliers.size()) >=
             kLeastInliers * static_cast<double>(window.size()) &&
         extent_m(inliers, along) >= kLeastLength_m &&
         extent_m(inliers, Vector3d::UnitZ()) >= kLeastHeight_m;
}

/// The wall of a cell; nullopt when it holds none.
std::optional<Plane> facade_in(const PlanePoints& points) {
  const std::optional<Plane> plane = find_plane(points);
  const bool is_wall =
      plane &&
      is_facade(*plane, near_to(*plane, points, kInlier_m), near_to(*plane, points, kWindow_m));
  return is_wall ? plane : std::nullopt;
}

/// Whether the cell holds it not only as a neighbour's.
bool is_own(const Plane& plane, const CellKey& key) {
  return index_of(plane.centre_m.x(), kCell_m) == key[0] &&
         index_of(plane.centre_m.y(), kCell_m) == key[1];
}

std::optional<double> thickness_in(const CellKey& key, const PlanePoints& points) {
  const std::optional<Plane> plane = facade_in(points);
  if (!plane || !is_own(*plane, key)) {
    return std::nullopt;
  }
  const PlanePoints window = near_to(*plane, points, kWindow_m);
  std::vector<double> distances_m;
  for (const Vector3d& p : window) {
    distances_m.push_back(plane->distance_m(p));
  }
  const double low = at_rank(distances_m, kLowRank);
  return 0.5 * (at_rank(distances_m, kHighRank) - low);
}

/// From the first cloud's wall to the second's, along its normal.
std::optional<double> offset_in(const CellKey& key,
                                const PlanePoints& first,
                                const PlanePoints& second) {
  const std::optional<Plane> of_first = facade_in(first);
  const std::optional<Plane> of_second = of_first ? facade_in(second) : std::nullopt;
  if (!of_second || !is_own(*of_first, key) ||
      std::abs(of_first->normal.dot(of_second->normal)) < std::cos(kMostTilt)) {
    return std::nullopt;
  }
  std::vector<double> distances_m;
  for (const Vector3d& p : near_to(*of_second, second, kInlier_m)) {
    distances_m.push_back(of_first->distance_m(p));
  }
  const double offset_m = std::abs(at_rank(distances_m, 0.5));
  return offset_m <= kWindow_m ? std::optional(offset_m) : std::nullopt;
}

}  // namespace

std::map<FacadeCell, Facade> facades_of(const PointCloud& cloud) {
  std::map<FacadeCell, Facade> facades;
  for (const auto& [key, points] : fill_cells(cloud, 1.0)) {
    const PlanePoints standing = upright(points);
    const std::optional<Plane> plane =
        standing.size() < kLeastPoints ? std::nullopt : facade_in(standing);
    if (plane) {
      facades.emplace(key, *plane);
    }
  }
  return facades;
}

std::optional<double> distance_between(const FacadeCell& cell,
                                       const Facade& first,
                                       const Facade& second) {
  if (!is_own(first, cell) || std::abs(first.normal.dot(second.normal)) < std::cos(kMostTilt)) {
    return std::nullopt;
  }
  const double offset_m = std::abs(first.distance_m(second.centre_m));
  return offset_m <= kWindow_m ? std::optional(offset_m) : std::nullopt;
}

FacadeOffset facade_offset(const PointCloud& first, const PointCloud& second) {
  const auto of_first = fill_cells(first, 1.0);
  const auto of_second = fill_cells(second, 1.0);
  std::vector<double> offsets_m;
  for (const auto& [key, points] : of_first) {
    const auto same = of_second.find(key);
    const PlanePoints standing = same == of_second.end() ? PlanePoints{} : upright(points);
    const PlanePoints others =
        standing.size() < kLeastPoints ? PlanePoints{} : upright(same->second);
    if (others.size() < kLeastPoints) {
      continue;
    }
    if (const auto offset_m = offset_in(key, standing, others)) {
      offsets_m.push_back(*offset_m);
    }
  }
  FacadeOffset result;
  result.planes = offsets_m.size();
  if (result.planes > 0) {
    result.median_m = at_rank(offsets_m, 0.5);
    result.p90_m = at_rank(offsets_m, 0.9);
  }
  return result;
}

PlaneThickness facade_thickness(const PointCloud& cloud, const PlaneThicknessOptions& options) {
  PlaneThickness result;
  if (cloud.size() > options.most_points) {
    result.share_looked_at =
        static_cast<double>(options.most_points) / static_cast<double>(cloud.size());
  }
  std::vector<double> thicknesses_m;
  for (const auto& [key, points] : fill_cells(cloud, result.share_looked_at)) {
    const PlanePoints standing = upright(points);
    if (standing.size() < kLeastPoints) {
      continue;
    }
    ++result.cells;
    if (const auto thickness = thickness_in(key, standing)) {
      thicknesses_m.push_back(*thickness);
    }
  }
  result.planes = thicknesses_m.size();
  if (result.planes > 0) {
    result.median_m = at_rank(thicknesses_m, 0.5);
    result.p90_m = at_rank(thicknesses_m, 0.9);
  }
  return result;
}

}  // namespace trigpoint::evaluation
