// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "moore_stouch.hpp"

#include <initializer_list>

namespace trigpoint::gps_odometry {

/// The set of these states (StateIndex plus 0 to 2).
inline MeasuredStates states(std::initializer_list<int> indices) {
  MeasuredStates measured;
  for (const int i : indices) {
    measured.set(static_cast<std::size_t>(i));
  }
  return measured;
}

}  // namespace trigpoint::gps_odometry
