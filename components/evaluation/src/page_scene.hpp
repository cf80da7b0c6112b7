// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "session_data.hpp"

#include <string>

namespace trigpoint::evaluation {

inline constexpr std::size_t kMostScenePoints = 800'000;

/// One point of each cube, the first; the cubes are as small as `most` points allow. In the order
/// of the cloud, so equal clouds give equal samples.
PointCloud sample_evenly(const PointCloud& cloud, std::size_t most);

/// What the page's script draws in 3-D, as `<script>` elements of data: points of the map in 16-bit
/// steps of the cloud's box, their intensities in 8 bits, and the trajectories with times. Empty
/// without points and without trajectories.
std::string scene_of(const SessionData& data,
                     const PointCloud& map,
                     std::size_t most_points = kMostScenePoints);

}  // namespace trigpoint::evaluation
