// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "local_map.hpp"
#include "surfel_points.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace trigpoint::lio_mapper {
namespace {

// ---- Against brute force: all leaf means, two-pass covariance, iterative eigen-solver --------

struct BrutePlane {
  Eigen::Vector3d normal;
  Eigen::Vector3d centroid;
  double thickness2_m2;
  double flatness;
};

std::optional<BrutePlane> brute_fit(const std::vector<Eigen::Vector3d>& points,
                                    const SurfelMapConfig& config) {
  if (points.size() < 5) {
    return std::nullopt;
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : points) {
    mean += p / static_cast<double>(points.size());
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& p : points) {
    covariance += (p - mean) * (p - mean).transpose() / static_cast<double>(points.size());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Eigen::Vector3d values = solver.eigenvalues();
  if (values[0] > config.max_flatness * values[2] || values[1] < config.min_linearity * values[2]) {
    return std::nullopt;
  }
  return BrutePlane{solver.eigenvectors().col(0), mean, values[0], values[0] / values[2]};
}

/// Leaf means whose leaf lies in the parent `home` widened by `reach` leaves on each axis.
std::vector<Eigen::Vector3d> brute_window(const PointCloud& means,
                                          const Eigen::Vector3i& home,
                                          const Eigen::Vector3i& reach) {
  std::vector<Eigen::Vector3d> inside;
  for (const PointXyzi& p : means) {
    const auto [x, y, z] = leaf_of(p, kLeaf_m);
    const Eigen::Array3i from_first = Eigen::Array3i(x, y, z) - 3 * home.array();
    if ((from_first >= -reach.array()).all() && (from_first < 3 + reach.array()).all()) {
      inside.push_back(p.position().cast<double>());
    }
  }
  return inside;
}

std::optional<BrutePlane> brute_plane(const PointCloud& means,
                                      const Eigen::Vector3i& home,
                                      const SurfelMapConfig& config) {
  const auto own = brute_window(means, home, {0, 0, 0});
  if (own.size() < 3) {
    return std::nullopt;
  }
  if (auto whole = brute_fit(brute_window(means, home, {1, 1, 1}), config)) {
    return whole;
  }
  std::optional<BrutePlane> best;
  for (const Eigen::Vector3i& axis : {Eigen::Vector3i(1, 0, 0), {0, 1, 0}, {0, 0, 1}}) {
    const auto window = brute_window(means, home, axis);
    const auto plane = window.size() > own.size() ? brute_fit(window, config) : std::nullopt;
    if (plane && (!best || plane->flatness < best->flatness)) {
      best = plane;
    }
  }
  return best ? best : brute_fit(own, config);
}

/// Three quarters of the parent's own points lie on it.
bool brute_is_surface(const std::vector<Eigen::Vector3d>& own, const BrutePlane& plane) {
  const auto on_plane = std::count_if(own.begin(), own.end(), [&](const Eigen::Vector3d& p) {
    return std::abs(plane.normal.dot(p - plane.centroid)) < 0.1;
  });
  return static_cast<double>(on_plane) >= 0.75 * static_cast<double>(own.size());
}

/// The match's definition: the own parent's plane when the point lies on it, else parents within
/// 0.4 m, cheapest plane by distance along and 3 x across.
std::optional<BrutePlane> brute_match(const PointCloud& means,
                                      const Eigen::Vector3d& p,
                                      const SurfelMapConfig& config) {
  constexpr double kReach_m = 0.4;
  const double across_limit_m = std::min(0.1, config.max_residual_m);
  std::optional<BrutePlane> best;
  double least = std::numeric_limits<double>::infinity();
  const auto cell = [](double v) { return static_cast<int>(std::floor(v / kParent_m)); };
  for (int x = cell(p.x() - kReach_m); x <= cell(p.x() + kReach_m); ++x) {
    for (int y = cell(p.y() - kReach_m); y <= cell(p.y() + kReach_m); ++y) {
      for (int z = cell(p.z() - kReach_m); z <= cell(p.z() + kReach_m); ++z) {
        const auto plane = brute_plane(means, {x, y, z}, config);
        if (!plane || !brute_is_surface(brute_window(means, {x, y, z}, {0, 0, 0}), *plane)) {
          continue;
        }
        const Eigen::Vector3d offset = p - plane->centroid;
        const bool own = x == cell(p.x()) && y == cell(p.y()) && z == cell(p.z());
        if (own && across_limit_m > std::abs(plane->normal.dot(offset))) {
          return plane;
        }
        const double across = std::abs(plane->normal.dot(offset));
        const double along2 = offset.squaredNorm() - across * across;
        const double cost = along2 + std::pow(3.0 * across, 2);
        if (across < config.max_residual_m && cost < least) {
          least = cost;
          best = plane;
        }
      }
    }
  }
  return best;
}

TEST(SurfelMap, agrees_with_brute_force_over_the_same_leaf_means) {
  SurfelMapConfig config;
  config.nearest_points = false;
  config.leaf_capacity = 1;         // means are points, so that single points can be judged, too
  constexpr double kSame_m = 1e-5;  // means are compared after rounding to float
  int matched = 0;
  for (unsigned seed = 0; seed < 4; ++seed) {
    const auto map = make_surfel_map(config);
    PointCloud cloud;
    for (const Eigen::Vector3d& p : random_points(400, 5.0, 40 + seed)) {
      // Rough relief with steps, folded to a band: planes, edges and clutter.
      const double z = 0.3 * p.x() + (p.y() > 0.0 ? 0.9 : 0.0) + 0.04 * p.z();
      cloud.push_back(point_of(away_from_faces({p.x(), p.y(), z})));
    }
    map->insert(cloud);
    const PointCloud means = map->points();
    for (const Eigen::Vector3d& q : random_points(300, 4.5, 50 + seed)) {
      const Eigen::Vector3d p(q.x(), q.y(), 0.3 * q.x() + 0.4 + 0.2 * q.z());
      PlaneMatch plane;
      const auto expected = brute_match(means, p, config);
      ASSERT_EQ(map->match(p, plane), expected.has_value());
      if (expected) {
        ++matched;
        EXPECT_NEAR(std::abs(plane.normal.dot(p) + plane.offset_m),
                    std::abs(expected->normal.dot(p - expected->centroid)),
                    kSame_m);
        EXPECT_NEAR(std::abs(plane.normal.dot(expected->normal)), 1.0, kSame_m);
        EXPECT_NEAR(plane.thickness2_m2, expected->thickness2_m2 + 2.5e-5, kSame_m);
      }
    }
  }
  EXPECT_GT(matched, 100);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
