// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How well a point of a scan agrees with a map, by its distance to what the map holds.
#pragma once

#include "trigpoint/base/point_cloud.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace trigpoint::lio_mapper {

/// The likelihood field of a map about a place: exp(-d^2 / (2 sigma^2)) of the distance d to the
/// nearest map point, kept for the cells of a grid (Thrun, Burgard, Fox, Probabilistic Robotics,
/// MIT Press 2005, section 6.4; as a grid to look in: Olson, Real-time correlative scan matching,
/// ICRA 2009). It asks for no surfaces: leaves have a place as walls have. Immutable.
class LikelihoodField {
 public:
  /// Of `map_points` that lie within `reach_m` of `centre_m` in the plane, and in height within
  /// kBelow_m and kAbove_m of it.
  LikelihoodField(const PointCloud& map_points, const Eigen::Vector3d& centre_m, double reach_m);

  /// 1 in a cell with a map point, 0 far from any and beyond the reach. Safe from several threads.
  double at(const Eigen::Vector3d& point_m) const {
    const Eigen::Vector3d cells = (point_m - corner_m_) / kCell_m;
    if (!((cells.array() >= 0.0).all() && (cells.array() < limit_).all())) {
      return 0.0;  // so does NaN
    }
    return kPerLevel * cells_[index(static_cast<int>(cells.x()),
                                    static_cast<int>(cells.y()),
                                    static_cast<int>(cells.z()))];
  }

  static constexpr double kCell_m = 0.2;
  /// A map keeps one point in half a metre: so far apart points on the same thing are.
  static constexpr double kSigma_m = 0.25;
  static constexpr double kBelow_m = 12.0;
  static constexpr double kAbove_m = 24.0;

 private:
  static constexpr double kPerLevel = 1.0 / 255.0;

  std::size_t index(int x, int y, int z) const {
    const auto at = [](int i) { return static_cast<std::size_t>(i); };
    return (at(x) * at(side_) + at(y)) * at(height_) + at(z);
  }

  Eigen::Vector3d corner_m_;
  int side_;    ///< cells in x and in y
  int height_;  ///< cells in z
  Eigen::Array3d limit_;
  std::vector<std::uint8_t> cells_;
};

}  // namespace trigpoint::lio_mapper
