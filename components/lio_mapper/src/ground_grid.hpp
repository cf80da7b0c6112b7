// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace trigpoint::lio_mapper {

/// The lowest point in each square of a grid around a place; good enough for a height of the
/// ground.
class GroundGrid {
 public:
  GroundGrid(const Eigen::Vector2d& centre_m, double half_side_m)
      : corner_m_(centre_m.array() - half_side_m),
        side_(1 + static_cast<int>(2.0 * half_side_m / kCell_m)),
        lowest_m_(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_), kNone) {}

  void add(const Eigen::Vector3d& point_m) {
    const int x = index_of(point_m.x() - corner_m_.x());
    const int y = index_of(point_m.y() - corner_m_.y());
    if (holds(x) && holds(y)) {
      double& lowest = cell(x, y);
      lowest = std::min(lowest, point_m.z());
    }
  }

  /// Median of the lowest points within `radius_m` of a place; nothing where there are too few.
  std::optional<double> height_at(const Eigen::Vector2d& place_m, double radius_m) const {
    const int reach = static_cast<int>(std::ceil(radius_m / kCell_m));
    const int centre_x = index_of(place_m.x() - corner_m_.x());
    const int centre_y = index_of(place_m.y() - corner_m_.y());
    std::vector<double> heights;
    for (int x = std::max(0, centre_x - reach); x <= std::min(side_ - 1, centre_x + reach); ++x) {
      for (int y = std::max(0, centre_y - reach); y <= std::min(side_ - 1, centre_y + reach); ++y) {
        const int dx = x - centre_x;
        const int dy = y - centre_y;
        const double lowest = cell(x, y);
        if (dx * dx + dy * dy <= reach * reach && lowest < kNone) {
          heights.push_back(lowest);
        }
      }
    }
    if (heights.size() < kFewest) {
      return std::nullopt;
    }
    const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
    std::nth_element(heights.begin(), middle, heights.end());
    return *middle;
  }

 private:
  static constexpr double kCell_m = 2.0;
  static constexpr std::size_t kFewest = 5;
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  static int index_of(double distance_m) {
    return static_cast<int>(std::floor(std::clamp(distance_m / kCell_m, -1.0, 1e6)));
  }

  bool holds(int index) const { return index >= 0 && index < side_; }

  double& cell(int x, int y) { return lowest_m_[static_cast<std::size_t>(x * side_ + y)]; }

  double cell(int x, int y) const { return lowest_m_[static_cast<std::size_t>(x * side_ + y)]; }

  Eigen::Vector2d corner_m_;
  int side_;
  std::vector<double> lowest_m_;
};

}  // namespace trigpoint::lio_mapper
