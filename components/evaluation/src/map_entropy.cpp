// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/map_quality.hpp"

#include "place_hash.hpp"
#include <Eigen/LU>

#include <array>
#include <cmath>
#include <map>
#include <numbers>

namespace trigpoint::evaluation {

namespace {

using Eigen::Vector3d;
using Key = std::array<std::int32_t, 3>;

constexpr double kBlock_m = 4.0;
constexpr double kFar_m = 1e7;  // an index of that size still fits
constexpr std::size_t kLeastNeighbours = 8;
/// Determinants (m^6) below this are of rounding: a plane of 0.5 m that is a micrometre thick.
constexpr double kSmallestDeterminant = 1e-15;

Key key_of(const Vector3d& p, double side_m) {
  const auto index = [&](double x) { return static_cast<std::int32_t>(std::floor(x / side_m)); };
  return {index(p.x()), index(p.y()), index(p.z())};
}

/// Calls `visit` for the keys of all cells that a cube of +-`reach_m` about the point touches.
template <typename Visit>
void for_keys_about(const Vector3d& p, double reach_m, double side_m, const Visit& visit) {
  const Key low = key_of(p.array() - reach_m, side_m);
  const Key high = key_of(p.array() + reach_m, side_m);
  for (std::int32_t i = low[0]; i <= high[0]; ++i) {
    for (std::int32_t j = low[1]; j <= high[1]; ++j) {
      for (std::int32_t k = low[2]; k <= high[2]; ++k) {
        visit(Key{i, j, k});
      }
    }
  }
}

using EntropyPoints = std::vector<Vector3d>;

/// Every block with the points in it and within the radius of it.
std::map<Key, EntropyPoints> fill_blocks(const PointCloud& cloud, double radius_m, double share) {
  std::map<Key, EntropyPoints> blocks;
  for (const PointXyzi& point : cloud) {
    const Vector3d p = point.position().cast<double>();
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > kFar_m) {
      continue;
    }
    for_keys_about(p, radius_m, kBlock_m, [&](const Key& key) {
      if (is_drawn(key, share)) {
        blocks[key].push_back(p);
      }
    });
  }
  return blocks;
}

/// Points about a place, summed up.
struct Neighbours {
  std::size_t count{0};
  Vector3d sum{Vector3d::Zero()};
  Eigen::Matrix3d squares{Eigen::Matrix3d::Zero()};

  /// nullopt when they do not span space.
  std::optional<double> entropy() const {
    if (count < kLeastNeighbours) {
      return std::nullopt;
    }
    const auto n = static_cast<double>(count);
    const Vector3d mean = sum / n;
    const Eigen::Matrix3d covariance = squares / n - mean * mean.transpose();
    const double determinant = covariance.determinant();
    if (!(determinant > kSmallestDeterminant)) {
      return std::nullopt;
    }
    constexpr double kTwoPiE = 2.0 * std::numbers::pi * std::numbers::e;
    return 0.5 * std::log(kTwoPiE * kTwoPiE * kTwoPiE * determinant);
  }
};

Neighbours neighbours_of(const Vector3d& p,
                         const std::map<Key, EntropyPoints>& cells,
                         double radius_m) {
  Neighbours found;
  for_keys_about(p, radius_m, radius_m, [&](const Key& key) {
    const auto cell = cells.find(key);
    if (cell == cells.end()) {
      return;
    }
    for (const Vector3d& q : cell->second) {
      const Vector3d d = q - p;  // about the point: sums of squares keep their digits
      if (d.squaredNorm() <= radius_m * radius_m) {
        ++found.count;
        found.sum += d;
        found.squares += d * d.transpose();
      }
    }
  });
  return found;
}

}  // namespace

MapEntropy mean_map_entropy(const PointCloud& cloud, double radius_m, std::size_t most_points) {
  MapEntropy result;
  result.radius_m = radius_m;
  if (cloud.size() > most_points) {
    result.share_looked_at = static_cast<double>(most_points) / static_cast<double>(cloud.size());
  }
  double sum = 0.0;
  for (const auto& [block, points] : fill_blocks(cloud, radius_m, result.share_looked_at)) {
    std::map<Key, EntropyPoints> cells;
    for (const Vector3d& p : points) {
      cells[key_of(p, radius_m)].push_back(p);
    }
    for (const Vector3d& p : points) {
      if (key_of(p, kBlock_m) != block) {
        continue;  // only there as a neighbour
      }
      if (const auto entropy = neighbours_of(p, cells, radius_m).entropy()) {
        sum += *entropy;
        ++result.points;
      } else {
        ++result.lonely;
      }
    }
  }
  if (result.points > 0) {
    result.mean = sum / static_cast<double>(result.points);
  }
  return result;
}

}  // namespace trigpoint::evaluation
