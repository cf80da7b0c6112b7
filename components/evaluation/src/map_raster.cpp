// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "map_raster.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::evaluation {

namespace {

constexpr double kFinestCell_m = 0.2;
/// The darkest cells saturate: one lamp post must not make everything else white.
constexpr double kSaturatedShare = 0.98;

/// Log count of which the given share of the occupied cells stays below.
float saturation_of(const std::vector<float>& log_counts) {
  std::vector<float> occupied;
  std::copy_if(log_counts.begin(), log_counts.end(), std::back_inserter(occupied), [](float v) {
    return v > 0.0F;
  });
  if (occupied.empty()) {
    return 1.0F;
  }
  const auto rank =
      static_cast<std::ptrdiff_t>(kSaturatedShare * static_cast<double>(occupied.size() - 1));
  std::nth_element(occupied.begin(), occupied.begin() + rank, occupied.end());
  return occupied[static_cast<std::size_t>(rank)];
}

}  // namespace

MapRaster rasterise(const PointCloud& cloud,
                    const Eigen::Vector2d& lowest_m,
                    const Eigen::Vector2d& highest_m,
                    int most_cells_a_side) {
  MapRaster raster;
  const Eigen::Vector2d size_m = highest_m - lowest_m;
  raster.lowest_m = lowest_m;
  raster.cell_m = std::max(kFinestCell_m, size_m.maxCoeff() / most_cells_a_side);
  raster.columns = std::max(1, static_cast<int>(std::ceil(size_m.x() / raster.cell_m)));
  raster.rows = std::max(1, static_cast<int>(std::ceil(size_m.y() / raster.cell_m)));
  std::vector<float>& cells = raster.darkness;
  cells.assign(static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows),
               0.0F);
  for (const auto& point : cloud) {
    const double x = (point.x - lowest_m.x()) / raster.cell_m;
    const double y = (point.y - lowest_m.y()) / raster.cell_m;
    if (x >= 0.0 && y >= 0.0 && x < raster.columns && y < raster.rows) {
      cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.columns) +
            static_cast<std::size_t>(x)] += 1.0F;
    }
  }
  std::transform(cells.begin(), cells.end(), cells.begin(), [](float n) { return std::log1p(n); });
  const float saturation = saturation_of(cells);
  for (float& cell : cells) {
    cell = std::min(1.0F, cell / saturation);
  }
  return raster;
}

}  // namespace trigpoint::evaluation
