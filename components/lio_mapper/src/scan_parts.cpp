// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "scan_parts.hpp"

#include "ground_grid.hpp"

#include <cmath>
#include <iterator>

namespace trigpoint::lio_mapper {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kGroundRadius_m = ScanParts::kGroundRadius_m;
constexpr double kStandsOut_m = 0.5;  // above the ground
constexpr double kOnGround_m = 0.3;   // from it
constexpr std::size_t kFewestOnGround = 50;
constexpr std::size_t kCoarsePoints = 200;
constexpr std::size_t kFinePoints = 2000;
constexpr std::size_t kGroundPoints = 500;

}  // namespace

ScanParts parts_of(const PointCloud& points_base, const Eigen::Quaterniond& q_level_base) {
  GroundGrid grid(Vector2d::Zero(), kGroundRadius_m + 2.0);
  std::vector<Vector3d> level;
  level.reserve(points_base.size());
  for (const PointXyzi& point : points_base) {
    level.push_back(q_level_base * point.position().cast<double>());
    grid.add(level.back());
  }
  ScanParts parts;
  parts.ground_m = grid.height_at(Vector2d::Zero(), kGroundRadius_m);
  if (parts.ground_m) {
    const double ground_m = *parts.ground_m;
    std::vector<Vector3d> ground;
    std::copy_if(level.begin(), level.end(), std::back_inserter(ground), [&](const Vector3d& p) {
      return std::abs(p.z() - ground_m) < kOnGround_m && p.head<2>().norm() < kGroundRadius_m;
    });
    if (ground.size() >= kFewestOnGround) {
      parts.ground_level_m = thinned(ground, kGroundPoints);
    }
    std::erase_if(level, [&](const Vector3d& p) { return p.z() <= ground_m + kStandsOut_m; });
  }
  std::erase_if(level, [](const Vector3d& p) { return p.norm() >= ScanParts::kFar_m; });
  const auto is_far = [](const Vector3d& p) { return p.norm() >= ScanParts::kNear_m; };
  const auto far = static_cast<std::size_t>(std::count_if(level.begin(), level.end(), is_far));
  if (level.size() - far >= ScanParts::kFewest) {
    std::erase_if(level, is_far);
  } else {
    parts.reach_m = ScanParts::kFar_m;
  }
  parts.count = level.size();
  parts.coarse_level_m = thinned(level, kCoarsePoints);
  parts.fine_level_m = thinned(level, kFinePoints);
  return parts;
}

}  // namespace trigpoint::lio_mapper
