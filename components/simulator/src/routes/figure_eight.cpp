// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "routes/figure_eight.hpp"

#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

void FigureEight::describe(ConfigFields& fields) {
  fields.number("length_m", length_m_, "from east to west", {10.0, 1e4});
  fields.number("width_m", width_m_, "from north to south", {10.0, 1e4});
  fields.number("speed_mps", speed_mps_, "wanted; curves may ask for less", {0.2, 40.0});
  fields.integer("laps", laps_, "how often it is driven", {1.0, 1000.0});
}

std::vector<RoutePoint> FigureEight::points() const {
  const auto steps = static_cast<int>(std::ceil(4.0 * (length_m_ + width_m_)));
  std::vector<RoutePoint> points;
  for (int i = 0; i <= steps * static_cast<int>(laps_); ++i) {
    const double angle = 2.0 * std::numbers::pi * i / steps;
    points.push_back({0.5 * length_m_ * std::sin(angle),
                      0.5 * width_m_ * std::sin(2.0 * angle),
                      speed_mps_,
                      0.0});
  }
  return points;
}

}  // namespace trigpoint::simulator
