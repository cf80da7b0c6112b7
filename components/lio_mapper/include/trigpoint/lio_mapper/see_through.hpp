// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Points of moving objects, told by what other scans see behind them.
// References: [1] G. Kim, A. Kim, "Remove, then Revert: Static Point cloud Map Construction using
// Multiresolution Range Images", IROS 2020 (range images of scans against the map). [2] A. Hornung
// et al., "OctoMap", Autonomous Robots 34, 2013 (hits against misses of each voxel).
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <memory>

namespace trigpoint::lio_mapper {

struct SeeThroughOptions {
  double voxel_m{0.2};
  double range_m{20.0};       ///< farther voxels are not judged by a scan
  double ray_radius_m{0.08};  ///< a ray that passes a voxel's points nearer than this goes through
  double margin_m{0.4};       ///< and ends farther behind them than this
  double least_incidence{0.3};  ///< sine against the voxel's plane; flatter rays skim it
  std::size_t least_views{2};   ///< that go through
  double views_per_hit{1.5};    ///< scans that go through against scans that hit
};

/// Two passes over all scans, then questions. Memory grows with the voxels that hold points (about
/// 100 bytes each). Deterministic.
class SeeThrough {
 public:
  explicit SeeThrough(const SeeThroughOptions& options = {});
  ~SeeThrough();

  /// First pass: which voxels hold points. In one frame throughout.
  void add(const PointCloud& points_map);
  /// Second pass: which of them this scan looks through. `origin_map_m`: of its rays.
  void look(const PointCloud& points_map, const Eigen::Vector3d& origin_map_m);
  /// After the second pass, once.
  void decide();

  bool is_moving(const PointXyzi& point_map) const;

  std::size_t voxels() const;
  std::size_t moving_voxels() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::lio_mapper
