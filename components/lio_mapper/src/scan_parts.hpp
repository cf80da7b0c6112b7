// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A scan apart into what stands out of the ground and the ground.
#pragma once

#include "trigpoint/base/point_cloud.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <optional>
#include <vector>

namespace trigpoint::lio_mapper {

/// Every n-th, so that at most `most` are left.
template <typename Points>
Points thinned(const Points& points, std::size_t most) {
  Points kept;
  const std::size_t step = std::max<std::size_t>(1, (points.size() + most - 1) / most);
  for (std::size_t i = 0; i < points.size(); i += step) {
    kept.push_back(points[i]);
  }
  return kept;
}

/// In level axes about base.
struct ScanParts {
  /// Farther points would fall through a grid of headings.
  static constexpr double kNear_m = 25.0;
  /// So far they are taken where too few are near.
  static constexpr double kFar_m = 50.0;
  static constexpr std::size_t kFewest = 80;
  /// What is the ground is judged so far around a place.
  static constexpr double kGroundRadius_m = 12.0;

  /// Height of the ground below base, negative; nothing where no ground is seen, and then
  /// everything stands out.
  std::optional<double> ground_m;
  double reach_m{kNear_m};                      ///< of the points that stand out
  std::size_t count{0};                         ///< of these
  std::vector<Eigen::Vector3d> coarse_level_m;  ///< at most 200 of them
  std::vector<Eigen::Vector3d> fine_level_m;    ///< at most 2000 of them
  std::vector<Eigen::Vector3d> ground_level_m;  ///< on the ground, at most 500; empty when few
};

ScanParts parts_of(const PointCloud& points_base, const Eigen::Quaterniond& q_level_base);

}  // namespace trigpoint::lio_mapper
