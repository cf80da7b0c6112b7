// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "map_raster.hpp"

#include <cstdint>
#include <vector>

namespace trigpoint::evaluation {

/// A raster as PNG, north up: grey of sixteen opacities, so that it lies over a light page and over
/// a dark one. Four bits a cell in stored (not compressed) blocks: no library is needed, and the
/// size is known beforehand.
std::vector<std::uint8_t> png_of(const MapRaster& raster);

}  // namespace trigpoint::evaluation
