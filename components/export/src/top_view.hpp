// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The map from above, as a picture and as heights.
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace trigpoint::exporter {

/// Cells over a rectangle of the horizontal plane (of UTM in m, or of longitude and latitude in
/// degrees). Row 0 is the northern one, as pictures have it.
struct Grid {
  Eigen::Vector2d north_west{Eigen::Vector2d::Zero()};  ///< outer corner: x, y
  Eigen::Vector2d cell{Eigen::Vector2d::Ones()};        ///< along x and y, both above 0
  int columns{0};
  int rows{0};

  std::size_t cells() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
};

/// Of cells of the given size, or of larger ones so that there are at most `most_cells`.
Grid grid_over(const Eigen::Vector2d& lowest,
               const Eigen::Vector2d& highest,
               const Eigen::Vector2d& cell,
               std::size_t most_cells = 16'000'000);

class TopView {
 public:
  explicit TopView(const Grid& grid);

  /// Points outside of the grid are left out.
  void add(const Eigen::Vector2d& place, double height_m);

  const Grid& grid() const { return grid_; }

  /// Highest point of each cell, row by row; NaN where there is none.
  const std::vector<float>& heights_m() const { return heights_m_; }

  /// Four bytes a cell, red green blue alpha: colour tells the height, brightness the slope in
  /// light from the north-west; transparent where there is no point.
  std::vector<std::uint8_t> picture() const;

 private:
  Grid grid_;
  std::vector<float> heights_m_;
};

}  // namespace trigpoint::exporter
