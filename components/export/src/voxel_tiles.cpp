// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "voxel_tiles.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace trigpoint::exporter {

namespace {

constexpr int kTileBits = 9;  // 512 cubes: 51.2 m at 0.1 m
constexpr std::int64_t kTileMask = (1 << kTileBits) - 1;
constexpr float kFurthest_m = 1e7F;

bool is_usable(const PointXyzi& point) {
  return std::abs(point.x) < kFurthest_m && std::abs(point.y) < kFurthest_m &&
         std::abs(point.z) < kFurthest_m;  // false for NaN too
}

}  // namespace

VoxelTiles::VoxelTiles(double voxel_m,
                       std::size_t most_voxels,
                       std::function<void(const PointCloud&)> emit)
    : voxel_m_(voxel_m), most_voxels_(most_voxels), emit_(std::move(emit)) {}

void VoxelTiles::add(const PointCloud& points) {
  ++turn_;
  for (const auto& point : points) {
    if (is_usable(point)) {
      add(point);
    }
  }
  while (voxels_ > most_voxels_ && tiles_.size() > 1) {
    emit_oldest();
  }
}

void VoxelTiles::add(const PointXyzi& point) {
  TileKey key{};
  std::uint32_t inside = 0;
  const std::array<float, 3> coordinates{point.x, point.y, point.z};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto index = static_cast<std::int64_t>(std::floor(coordinates[i] / voxel_m_));
    key[i] = static_cast<std::int32_t>(index >> kTileBits);
    inside = (inside << kTileBits) | static_cast<std::uint32_t>(index & kTileMask);
  }
  auto& tile = tiles_[key];
  tile.touched = turn_;
  auto& sum = tile.voxels[inside];
  voxels_ += sum.count == 0 ? 1 : 0;
  sum.x += point.x;
  sum.y += point.y;
  sum.z += point.z;
  sum.intensity += std::isfinite(point.intensity) ? point.intensity : 0.0F;
  ++sum.count;
}

void VoxelTiles::emit_oldest() {
  const auto oldest =
      std::min_element(tiles_.begin(), tiles_.end(), [](const auto& a, const auto& b) {
        return a.second.touched < b.second.touched;
      });
  emit_tile(oldest->second);
  tiles_.erase(oldest);
}

void VoxelTiles::emit_tile(const Tile& tile) {
  std::vector<std::pair<std::uint32_t, Sum>> sorted(tile.voxels.begin(), tile.voxels.end());
  std::sort(
      sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  PointCloud points;
  points.reserve(sorted.size());
  for (const auto& [key, sum] : sorted) {
    const double n = sum.count;
    points.push_back({static_cast<float>(sum.x / n),
                      static_cast<float>(sum.y / n),
                      static_cast<float>(sum.z / n),
                      static_cast<float>(sum.intensity / n)});
  }
  voxels_ -= sorted.size();
  emit_(points);
}

void VoxelTiles::finish() {
  for (const auto& [key, tile] : tiles_) {
    emit_tile(tile);
  }
  tiles_.clear();
}

}  // namespace trigpoint::exporter
