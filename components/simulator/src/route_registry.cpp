// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "route.hpp"
#include "routes/circle.hpp"
#include "routes/figure_eight.hpp"
#include "routes/waypoints.hpp"

namespace trigpoint::simulator {

const Registry<Route>& route_registry() {
  static const Registry<Route> registry{
      {"circle", [] { return std::make_shared<Circle>(); }},
      {"figure_eight", [] { return std::make_shared<FigureEight>(); }},
      {"waypoints", [] { return std::make_shared<Waypoints>(); }},
  };
  return registry;
}

}  // namespace trigpoint::simulator
