// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "likelihood_field.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

constexpr double kReach_sigmas = 3.0;

/// A cell beside one with a map point.
struct Beside {
  int x;
  int y;
  int z;
  std::uint8_t level;
};

std::vector<Beside> neighbourhood() {
  const int reach =
      static_cast<int>(kReach_sigmas * LikelihoodField::kSigma_m / LikelihoodField::kCell_m);
  std::vector<Beside> cells;
  for (int x = -reach; x <= reach; ++x) {
    for (int y = -reach; y <= reach; ++y) {
      for (int z = -reach; z <= reach; ++z) {
        const double ratio = LikelihoodField::kCell_m / LikelihoodField::kSigma_m;
        const double value = std::exp(-0.5 * ratio * ratio * (x * x + y * y + z * z));
        const auto level = static_cast<std::uint8_t>(std::lround(255.0 * value));
        if (level > 0) {
          cells.push_back({x, y, z, level});
        }
      }
    }
  }
  return cells;
}

}  // namespace

LikelihoodField::LikelihoodField(const PointCloud& map_points,
                                 const Eigen::Vector3d& centre_m,
                                 double reach_m)
    : corner_m_(centre_m - Eigen::Vector3d(reach_m, reach_m, kBelow_m)),
      side_(1 + static_cast<int>(2.0 * reach_m / kCell_m)),
      height_(1 + static_cast<int>((kBelow_m + kAbove_m) / kCell_m)),
      limit_(side_, side_, height_),
      cells_(index(side_ - 1, side_ - 1, height_ - 1) + 1, 0) {
  const std::vector<Beside> around = neighbourhood();
  constexpr std::uint8_t kFull = 255;
  for (const PointXyzi& point : map_points) {
    const Eigen::Vector3d cells = (point.position().cast<double>() - corner_m_) / kCell_m;
    if (!((cells.array() >= 0.0).all() && (cells.array() < limit_).all())) {
      continue;
    }
    const Eigen::Vector3i at = cells.cast<int>();
    if (cells_[index(at.x(), at.y(), at.z())] == kFull) {
      continue;  // another point of this cell was here
    }
    for (const Beside& b : around) {
      const int x = at.x() + b.x;
      const int y = at.y() + b.y;
      const int z = at.z() + b.z;
      if (x >= 0 && x < side_ && y >= 0 && y < side_ && z >= 0 && z < height_) {
        std::uint8_t& cell = cells_[index(x, y, z)];
        cell = std::max(cell, b.level);
      }
    }
  }
}

}  // namespace trigpoint::lio_mapper
