// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/simulator/scenario.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>

namespace trigpoint::simulator {

/// The smooth ground: a sum of plane waves, so height and slope are known in closed form
/// everywhere.
class Relief {
 public:
  Relief(const WorldConfig& config, std::uint64_t seed);

  double height_m(double east_m, double north_m) const;
  /// d height / d east, d height / d north.
  Eigen::Vector2d slope(double east_m, double north_m) const;

  /// No place is steeper (norm of the slope).
  double steepest() const { return steepest_; }

  double highest_m() const { return highest_m_; }

 private:
  struct Wave {
    Eigen::Vector2d k_radpm;
    double phase_rad;
    double amplitude_m;
  };

  std::array<Wave, 3> waves_;
  double steepest_{0.0};
  double highest_m_{0.0};
  double offset_m_{0.0};  ///< makes the height 0 at the origin
};

}  // namespace trigpoint::simulator
