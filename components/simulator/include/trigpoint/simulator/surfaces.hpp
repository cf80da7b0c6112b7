// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where the surfaces of a scenario's world really are: for scoring maps, never for making them.
#pragma once

#include "trigpoint/simulator/scenario.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>

namespace trigpoint::simulator {

class Surfaces {
 public:
  /// Of the world that a drive with this seed goes through.
  Surfaces(const Scenario& scenario, std::uint64_t seed);
  ~Surfaces();
  Surfaces(const Surfaces&) = delete;
  Surfaces& operator=(const Surfaces&) = delete;

  /// Distance (m) from a position in map at the scenario's datum to the nearest of ground, houses,
  /// cars that are parked, posts and trunks; `kFarthest_m` when none is nearer. nullopt in leaves
  /// (tree crowns, grass), which have no surface. Safe to call from several threads.
  std::optional<double> distance_m(const Eigen::Vector3d& p_map_m) const;

  static constexpr double kFarthest_m = 1.0;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::simulator
