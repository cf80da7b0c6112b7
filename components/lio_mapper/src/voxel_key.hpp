// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace trigpoint::lio_mapper {

/// Index of a voxel: floor(coordinate / side) on each axis.
struct VoxelIndex {
  std::int32_t x{0};
  std::int32_t y{0};
  std::int32_t z{0};
};

/// Indices lie in [-kVoxelLimit, kVoxelLimit): 21 bits an axis.
inline constexpr std::int32_t kVoxelLimit = 1 << 20;

/// Three indices in one word, so that a look-up compares one number.
using VoxelKey = std::uint64_t;

constexpr VoxelKey voxel_key(const VoxelIndex& index) {
  const auto bits = [](std::int32_t i) { return static_cast<VoxelKey>(i + kVoxelLimit); };
  return (bits(index.x) << 42) | (bits(index.y) << 21) | bits(index.z);
}

/// False for NaN and for what lies beyond kVoxelLimit.
inline bool voxel_index_fits(double x, double y, double z, double inverse_side) {
  constexpr double kLimit = kVoxelLimit - 2;  // two spare, for neighbours
  return std::abs(x * inverse_side) < kLimit && std::abs(y * inverse_side) < kLimit &&
         std::abs(z * inverse_side) < kLimit;
}

inline std::int32_t voxel_coordinate(double value, double inverse_side) {
  return static_cast<std::int32_t>(std::floor(value * inverse_side));
}

/// Only for coordinates that voxel_index_fits.
inline VoxelIndex voxel_index(double x, double y, double z, double inverse_side) {
  return {voxel_coordinate(x, inverse_side),
          voxel_coordinate(y, inverse_side),
          voxel_coordinate(z, inverse_side)};
}

/// Neighbouring keys must not land in neighbouring slots: finalizer of MurmurHash3 (public domain).
struct VoxelKeyHash {
  std::size_t operator()(VoxelKey key) const {
    key ^= key >> 33;
    key *= 0xff51afd7ed558ccdULL;
    key ^= key >> 33;
    key *= 0xc4ceb9fe1a85ec53ULL;
    key ^= key >> 33;
    return static_cast<std::size_t>(key);
  }
};

}  // namespace trigpoint::lio_mapper
