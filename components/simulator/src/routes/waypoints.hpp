// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "route.hpp"

namespace trigpoint::simulator {

/// Straight stretches between given corners, joined by arcs.
class Waypoints final : public Route {
 public:
  void describe(ConfigFields& fields) override;
  /// Throws ConfigError when there are too few corners, two in one place, or one too sharp.
  std::vector<RoutePoint> points() const override;

 private:
  double corner_radius_m_{7.0};
  std::vector<RoutePoint> corners_;
};

}  // namespace trigpoint::simulator
