// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "route.hpp"

namespace trigpoint::simulator {

/// Laps of a lemniscate of Gerono through the origin: turns both ways, no straight stretch.
class FigureEight final : public Route {
 public:
  void describe(ConfigFields& fields) override;
  std::vector<RoutePoint> points() const override;

 private:
  double length_m_{60.0};
  double width_m_{30.0};
  double speed_mps_{3.0};
  std::int64_t laps_{1};
};

}  // namespace trigpoint::simulator
