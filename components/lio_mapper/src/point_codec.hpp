// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Clouds in few bytes: coordinates as differences of whole millimetres, intensities as they are,
// sorted by significance of their bytes and packed with Zstandard (RFC 8878). KEYFRAMES.md has the
// layout.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace trigpoint::lio_mapper {

/// Coordinates are kept to half of this.
inline constexpr double kStoredResolution_m = 1e-3;

/// Throws std::runtime_error for a coordinate that is not finite or beyond 1000 km.
std::vector<std::uint8_t> pack_points(const PointCloud& points);

/// The number of points in packed bytes, without unpacking. Throws std::runtime_error when there
/// are too few bytes.
std::size_t packed_count(const void* bytes, std::size_t size);

/// Throws std::runtime_error that says what is wrong with the bytes.
PointCloud unpack_points(const void* bytes, std::size_t size);

}  // namespace trigpoint::lio_mapper
