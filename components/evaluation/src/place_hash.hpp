// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A share of all cells, drawn by their place: the same cells for every map of that place.
#pragma once

#include <array>
#include <cstdint>

namespace trigpoint::evaluation {

/// Evenly spread over 64 bits (finaliser of splitmix64, S. Vigna).
inline std::uint64_t hash_of(const std::array<std::int32_t, 3>& key) {
  std::uint64_t h = 0;
  for (const std::int32_t i : key) {
    h = (h ^ static_cast<std::uint32_t>(i)) + 0x9E3779B97F4A7C15ULL;
    h = (h ^ (h >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    h = (h ^ (h >> 27U)) * 0x94D049BB133111EBULL;
    h ^= h >> 31U;
  }
  return h;
}

inline bool is_drawn(const std::array<std::int32_t, 3>& key, double share) {
  return share >= 1.0 || (hash_of(key) >> 1U) < static_cast<std::uint64_t>(share * 0x1p63);
}

}  // namespace trigpoint::evaluation
