// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/simulator/scenario.hpp"

#include "path.hpp"

#include <vector>

namespace trigpoint::simulator {

/// How far along the path the robot is at each moment: as fast as wanted, within the limits of
/// acceleration, slower in curves, standing at the start, at stops and at the end.
class SpeedProfile {
 public:
  SpeedProfile(const Path& path, const MotionConfig& config);

  /// Distance (m) along the path; negative before a moving start.
  double distance_m(double t_s) const;

 private:
  struct Node {
    double t_s;
    double s_m;
    double v_mps;
  };

  std::vector<Node> nodes_;  ///< constant acceleration in between
};

}  // namespace trigpoint::simulator
