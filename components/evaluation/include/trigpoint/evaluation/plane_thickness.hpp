// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How sharp a map is: the thickness of its facades. A relative of the mean plane variance of
// [1] J. Razlaw, D. Droeschel, D. Holz, S. Behnke, "Evaluation of Registration Methods for Sparse
//     3D Laser Scans", ECMR 2015,
// which averages the variance across planes that are fitted to small neighbourhoods. Here only
// upright planes count, what lies beside the plane counts too (so that a wall that was mapped twice
// is as thick as its two copies are apart), and the spread is one of percentiles.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"

#include <cstddef>

namespace trigpoint::evaluation {

struct PlaneThicknessOptions {
  /// With more points only a share of the cells is looked at, drawn by a hash of their place.
  std::size_t most_points{4'000'000};
};

/// Thickness of a plane: half the width of the band that holds the middle 68.3 % of its points,
/// across it. That is the standard deviation of normally distributed errors, and half the distance
/// of the copies of a double wall.
struct PlaneThickness {
  std::size_t planes{0};        ///< 0: the numbers below are NaN
  std::size_t cells{0};         ///< looked at: those with points enough, above each other
  double share_looked_at{1.0};  ///< of all cells
  double median_m{kNaN};
  double p90_m{kNaN};  ///< nearest rank
};

/// Upright planes in cells of 2 m (README, "Thickness of facades"). Time grows with the points,
/// up to `most_points` of them; the same cloud gives the same result.
PlaneThickness facade_thickness(const PointCloud& cloud, const PlaneThicknessOptions& options = {});

/// How far the same walls lie apart in two clouds of one frame.
struct FacadeOffset {
  std::size_t planes{0};  ///< walls that both hold; 0: the numbers below are NaN
  double median_m{kNaN};
  double p90_m{kNaN};  ///< nearest rank
};

/// Of the walls that facade_thickness finds in each of them. Walls more than 0.4 m or 10 degrees
/// apart are taken for different ones.
FacadeOffset facade_offset(const PointCloud& first, const PointCloud& second);

}  // namespace trigpoint::evaluation
