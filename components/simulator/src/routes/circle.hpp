// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "route.hpp"

namespace trigpoint::simulator {

/// Laps of a circle that begin at the origin to the east. After half a lap the robot really drives
/// the given radius at the given speed: what the path's rounding takes away is added here.
class Circle final : public Route {
 public:
  void describe(ConfigFields& fields) override;
  std::vector<RoutePoint> points() const override;

 private:
  double radius_m_{4.0};
  double speed_mps_{2.0};
  bool clockwise_{false};
  std::int64_t laps_{1};
};

}  // namespace trigpoint::simulator
