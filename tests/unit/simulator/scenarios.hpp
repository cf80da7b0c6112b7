// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Small scenarios for the tests.
#pragma once

#include "trigpoint/simulator/scenario.hpp"

#include <string>

namespace trigpoint::simulator {

/// An L-shaped drive of about 20 s, on relief, through nothing in particular; `more` is YAML added
/// to it.
inline Scenario small_scenario(const std::string& more = "") {
  return load_scenario_text(
      "duration_s: 20.0\n"
      "route:\n"
      "  type: waypoints\n"
      "  waypoints:\n"
      "    - {east_m: 0.0, north_m: 0.0, speed_mps: 4.0}\n"
      "    - {east_m: 30.0, north_m: 0.0, speed_mps: 3.0}\n"
      "    - {east_m: 30.0, north_m: 40.0}\n" +
          more,
      "small.yaml");
}

}  // namespace trigpoint::simulator
