// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

namespace trigpoint::gps_odometry {

/// The value that a chi-square variable of 1 degree of freedom exceeds with 1 - probability.
double chi_square_limit_1(double probability);

/// The same for 2 degrees of freedom.
double chi_square_limit_2(double probability);

/// The same for 3 degrees of freedom.
double chi_square_limit_3(double probability);

}  // namespace trigpoint::gps_odometry
