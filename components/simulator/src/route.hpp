// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/config.hpp"
#include "trigpoint/simulator/scenario.hpp"

#include "registry.hpp"

#include <vector>

namespace trigpoint::simulator {

/// A place on the way. The list need not be dense; it is driven along straight lines, rounded a
/// little.
struct RoutePoint {
  double east_m{0.0};
  double north_m{0.0};
  double speed_mps{3.0};  ///< wanted from here on; curves may ask for less
  double stop_s{0.0};     ///< stand here that long
};

/// The plan view of a drive. A new kind is a class in its own file under routes/ and one line in
/// route_registry.cpp.
class Route {
 public:
  virtual ~Route() = default;
  virtual void describe(ConfigFields& fields) = 0;
  /// At least two points; neighbours differ; no corner sharper than a vehicle can turn.
  virtual std::vector<RoutePoint> points() const = 0;
};

const Registry<Route>& route_registry();

/// The scenario's route as it is driven: from motion.start_m on, or from its end back. Throws
/// ConfigError when nothing is left to drive.
std::vector<RoutePoint> driven_route(const Scenario& scenario);

}  // namespace trigpoint::simulator
