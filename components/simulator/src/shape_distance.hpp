// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "shapes.hpp"
#include <Eigen/Core>

namespace trigpoint::simulator {

/// From a position to the nearest point of a box's or a cylinder's surface, inside too. Without
/// meaning for leaves.
double surface_distance_m(const Shape& shape, const Eigen::Vector3d& p_map_m);

/// Whether leaves could stop a ray there, or within `margin_m` of it.
bool is_in_leaves(const Shape& shape, const Eigen::Vector3d& p_map_m, double margin_m);

}  // namespace trigpoint::simulator
