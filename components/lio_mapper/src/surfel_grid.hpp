// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Leaves and parents of SurfelMap, for its own source files.
#pragma once

#include "voxel_key.hpp"

#include <cstdint>

namespace trigpoint::lio_mapper::surfel_grid {

inline constexpr int kSide = 3;  // leaves along a parent

/// A point nearer than this to the face of an empty leaf may belong to the leaf behind the face, in
/// parts of a leaf's side (5 cm of 0.5 m: 2.5 sigma of a LiDAR's range noise).
inline constexpr double kFaceBand = 0.1;

constexpr int slot(int x, int y, int z) {
  return (x * kSide + y) * kSide + z;
}

inline std::int32_t floor_div3(std::int32_t i) {
  return (i >= 0 ? i : i - (kSide - 1)) / kSide;
}

inline VoxelIndex neighbour_index(const VoxelIndex& index, int direction) {
  return {
      index.x + direction / 9 - 1, index.y + direction / 3 % 3 - 1, index.z + direction % 3 - 1};
}

}  // namespace trigpoint::lio_mapper::surfel_grid
