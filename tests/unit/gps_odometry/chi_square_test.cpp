// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "chi_square.hpp"

#include <gtest/gtest.h>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kTableDigits = 5e-3;

TEST(ChiSquare, agrees_with_the_printed_tables) {
  EXPECT_NEAR(chi_square_limit_1(0.95), 3.84, kTableDigits);
  EXPECT_NEAR(chi_square_limit_1(0.999), 10.83, kTableDigits);
  EXPECT_NEAR(chi_square_limit_2(0.95), 5.99, kTableDigits);
  EXPECT_NEAR(chi_square_limit_2(0.999), 13.82, kTableDigits);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
