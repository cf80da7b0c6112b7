// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/simulator/scenario.hpp"

#include "path.hpp"
#include "relief.hpp"
#include "shapes.hpp"

#include <cstdint>
#include <vector>

namespace trigpoint::simulator {

/// Builds what stands along the path: halls as configured, and from the seed buildings, parked
/// cars, poles and trees, none of them in the way.
std::vector<Shape> build_town(const WorldConfig& config,
                              const Path& path,
                              const Relief& relief,
                              std::uint64_t seed);

}  // namespace trigpoint::simulator
