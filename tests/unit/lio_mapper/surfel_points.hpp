// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Points for tests of the surfel map, and the leaves and parents that they fall into.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <Eigen/Core>

#include <cmath>
#include <random>
#include <tuple>
#include <vector>

namespace trigpoint::lio_mapper {

inline constexpr double kLeaf_m = 0.5;
inline constexpr double kParent_m = 1.5;

inline PointXyzi point_of(const Eigen::Vector3d& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), 1.0F};
}

inline std::vector<Eigen::Vector3d> random_points(int count, double half_side_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> coordinate(-half_side_m, half_side_m);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = coordinate(random);
    const double y = coordinate(random);
    const double z = coordinate(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

/// The same point moved out of the bands near the faces of leaves, where a point may be given to
/// the leaf behind the face: for tests that compute leaves by themselves.
inline Eigen::Vector3d away_from_faces(const Eigen::Vector3d& p) {
  constexpr double kBand = 0.101;
  const auto moved = [](double v) {
    const double cell = std::floor(v / kLeaf_m);
    return kLeaf_m * (cell + kBand + (1.0 - 2.0 * kBand) * (v / kLeaf_m - cell));
  };
  return {moved(p.x()), moved(p.y()), moved(p.z())};
}

using LeafKey = std::tuple<int, int, int>;

inline LeafKey leaf_of(const PointXyzi& p, double side_m) {
  return {static_cast<int>(std::floor(p.x / side_m)),
          static_cast<int>(std::floor(p.y / side_m)),
          static_cast<int>(std::floor(p.z / side_m))};
}

}  // namespace trigpoint::lio_mapper
