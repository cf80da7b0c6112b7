// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The world of a scenario, without its sensors.
#pragma once

#include "drive.hpp"
#include "path.hpp"
#include "relief.hpp"
#include "route.hpp"
#include "town.hpp"
#include "world.hpp"

#include <cstdint>
#include <string>

namespace trigpoint::simulator {

struct Place {
  explicit Place(const Scenario& described, std::uint64_t seed = 1)
      : scenario(described),
        relief(scenario.world, seed),
        drive(scenario, relief, seed, scenario.duration_s),
        world(relief,
              build_town(scenario.world, Path(scenario.route->points()), relief, seed),
              drive.track(1.0),
              120.0,
              scenario.world.grass_height_m) {}

  explicit Place(const std::string& name, std::uint64_t seed = 1)
      : Place(load_scenario(name), seed) {}

  /// Where the scanner is.
  Eigen::Vector3d scanner_m(double t_s) const {
    return drive.at_time(t_s).T_map_base * scenario.robot.lidar_position_base_m;
  }

  Scenario scenario;
  Relief relief;
  Drive drive;
  World world;
};

/// Hits of rays in every direction between two elevations.
template <typename Use>
void look_around(const Place& place, const Eigen::Vector3d& from_m, const Use& use) {
  std::uint64_t key = 0;
  for (double elevation = -0.26; elevation <= 0.26; elevation += 0.035) {
    for (double azimuth = 0.0; azimuth < 6.28; azimuth += 0.01) {
      const Ray ray{from_m,
                    {std::cos(elevation) * std::cos(azimuth),
                     std::cos(elevation) * std::sin(azimuth),
                     std::sin(elevation)},
                    ++key};
      const Hit hit = place.world.cast(ray, 100.0);
      if (hit.is_hit()) {
        use(ray, hit);
      }
    }
  }
}

}  // namespace trigpoint::simulator
