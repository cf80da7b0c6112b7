// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "sweep.hpp"

#include <vector>

namespace trigpoint::lio_mapper {

/// Keeps, of all points in a voxel, one: a measured point and not a mean, spread as evenly as the
/// grid. It is the one nearest to the voxel's centre (the rule of FAST-LIO2's on-tree
/// down-sampling, W. Xu et al., T-RO 2022, section V.C), but along axes along which the points of
/// the voxel scatter by their noise only, as across a surface, the one nearest to their mean: there
/// the noise would choose, always towards the centre. A grid that goes with the robot has the
/// ground always at the same place in its voxels, and what lies ahead comes out too high or too low
/// scan after scan: it bent the map by 4 cm in 40 m. Voxels are cubes of `voxel_m` with a corner at
/// the origin. Points keep the order of their voxels' first points; of equally near ones the first
/// stays. Points that are not finite, or farther than 2^20 voxels, are left out. Without a positive
/// `voxel_m` nothing is thinned.
PointCloud downsample(const PointCloud& points, double voxel_m);
std::vector<TimedPoint> downsample(const std::vector<TimedPoint>& points, double voxel_m);

}  // namespace trigpoint::lio_mapper
