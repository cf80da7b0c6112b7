// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// Points seen from above, binned: how dark a cell is grows with the logarithm of its points, so
/// that what stands (many points above each other) is dark and the ground light.
struct MapRaster {
  Eigen::Vector2d lowest_m{Eigen::Vector2d::Zero()};  ///< corner of the first cell
  double cell_m{1.0};
  int columns{0};               ///< along x
  int rows{0};                  ///< along y, from the south
  std::vector<float> darkness;  ///< 0 to 1, row by row
};

MapRaster rasterise(const PointCloud& cloud,
                    const Eigen::Vector2d& lowest_m,
                    const Eigen::Vector2d& highest_m,
                    int most_cells_a_side);

}  // namespace trigpoint::evaluation
