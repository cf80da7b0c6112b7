// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

namespace trigpoint::gps_odometry {

inline constexpr double kGravity_mps2 = 9.80665;

}  // namespace trigpoint::gps_odometry
