// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "routes/circle.hpp"

#include "path.hpp"

#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

namespace {

constexpr double kSide_m = 0.05;  ///< of the polygon: 0.1 mm inside a circle of 4 m

}  // namespace

void Circle::describe(ConfigFields& fields) {
  fields.number("radius_m", radius_m_, "as driven", {2.0, 1e4});
  fields.number("speed_mps", speed_mps_, "wanted; the lateral limit may ask for less", {0.2, 40.0});
  fields.flag("clockwise", clockwise_, "turns right instead of left");
  fields.integer("laps", laps_, "how often it is driven", {1.0, 1000.0});
}

std::vector<RoutePoint> Circle::points() const {
  const double radius_m = radius_before_rounding_m(radius_m_);
  const double speed_mps = speed_mps_ * radius_m / radius_m_;
  const auto steps = static_cast<int>(std::ceil(2.0 * std::numbers::pi * radius_m / kSide_m));
  const double side = clockwise_ ? -1.0 : 1.0;
  std::vector<RoutePoint> points;
  for (int i = 0; i <= steps * static_cast<int>(laps_); ++i) {
    const double angle = 2.0 * std::numbers::pi * i / steps;
    points.push_back(
        {radius_m * std::sin(angle), side * radius_m * (1.0 - std::cos(angle)), speed_mps, 0.0});
  }
  return points;
}

}  // namespace trigpoint::simulator
