// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Upright planes of a cloud, one a cell (README, "Thickness of facades").
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <map>
#include <optional>

namespace trigpoint::evaluation {

using FacadeCell = std::array<std::int32_t, 3>;

struct Facade {
  Eigen::Vector3d normal;
  Eigen::Vector3d centre_m;  ///< mean of its points

  double distance_m(const Eigen::Vector3d& p) const { return normal.dot(p - centre_m); }
};

/// By the cell in which it was found; a wall near a cell's border is in both cells.
std::map<FacadeCell, Facade> facades_of(const PointCloud& cloud);

/// Between two facades of one cell, along the first one's normal; nullopt when the first is a
/// neighbour cell's, or they are different walls (0.4 m or 10 degrees apart).
std::optional<double> distance_between(const FacadeCell& cell,
                                       const Facade& first,
                                       const Facade& second);

}  // namespace trigpoint::evaluation
