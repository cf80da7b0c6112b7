// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <unordered_map>

namespace trigpoint::exporter {

/// Averages points in cubes. Cubes are kept in tiles; when there are more cubes than `most_voxels`,
/// the tiles that were not touched for longest are handed to `emit`, so memory stays bounded
/// however long the drive. (A place seen again after that gets a second point in its cubes.) What
/// is emitted, and in which order, depends on the input only.
class VoxelTiles {
 public:
  VoxelTiles(double voxel_m, std::size_t most_voxels, std::function<void(const PointCloud&)> emit);

  /// Points further than 1e7 m from the origin, or not finite, are left out.
  void add(const PointCloud& points);
  void finish();

 private:
  struct Sum {
    double x{0.0};
    double y{0.0};
    double z{0.0};
    double intensity{0.0};
    std::uint32_t count{0};
  };

  struct Tile {
    std::unordered_map<std::uint32_t, Sum> voxels;
    std::uint64_t touched{0};
  };

  using TileKey = std::array<std::int32_t, 3>;

  void add(const PointXyzi& point);
  void emit_oldest();
  void emit_tile(const Tile& tile);

  double voxel_m_;
  std::size_t most_voxels_;
  std::function<void(const PointCloud&)> emit_;
  std::map<TileKey, Tile> tiles_;
  std::size_t voxels_{0};
  std::uint64_t turn_{0};
};

}  // namespace trigpoint::exporter
