// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "chi_square.hpp"

#include <cmath>
#include <numbers>

namespace trigpoint::gps_odometry {

double chi_square_limit_1(double probability) {
  // Bisection of P(|z| <= s) = erf(s / sqrt 2); 60 halvings are exact to the last digit.
  double low = 0.0;
  double high = 10.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erf(middle / std::sqrt(2.0)) < probability ? low : high) = middle;
  }
  return low * low;
}

double chi_square_limit_2(double probability) {
  return -2.0 * std::log(1.0 - probability);
}

double chi_square_limit_3(double probability) {
  // P(x) = erf(sqrt(x/2)) - sqrt(2 x / pi) exp(-x/2), by bisection of s = sqrt(x).
  double low = 0.0;
  double high = 12.0;
  for (int i = 0; i < 60; ++i) {
    const double s = 0.5 * (low + high);
    const double below = std::erf(s / std::numbers::sqrt2) -
                         std::sqrt(2.0 / std::numbers::pi) * s * std::exp(-0.5 * s * s);
    (below < probability ? low : high) = s;
  }
  return low * low;
}

}  // namespace trigpoint::gps_odometry
