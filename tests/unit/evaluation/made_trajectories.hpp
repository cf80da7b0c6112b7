// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/so3.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"

#include <cmath>

namespace trigpoint::evaluation::test {

inline constexpr Nanoseconds kStep_ns = 100'000'000;
inline constexpr Nanoseconds kStart_ns = 1'317'377'394'000'000'000;

/// A drive along +x at `step_m` a pose (10 Hz), heading along x.
inline Trajectory straight(int poses, double step_m, Nanoseconds start_ns = kStart_ns) {
  Trajectory trajectory;
  for (int i = 0; i < poses; ++i) {
    trajectory.push_back(
        {start_ns + i * kStep_ns, Pose(Eigen::Quaterniond::Identity(), {i * step_m, 0.0, 0.0})});
  }
  return trajectory;
}

/// A rising helix: no symmetry that an alignment could hide behind.
inline Trajectory helix(int poses) {
  Trajectory trajectory;
  for (int i = 0; i < poses; ++i) {
    const double a = 0.05 * i;
    trajectory.push_back(
        {kStart_ns + i * kStep_ns,
         Pose(from_roll_pitch_yaw({0.02, -0.03, a}),
              {10.0 * std::cos(a), 7.0 * std::sin(a), 0.3 * a + 0.5 * std::sin(3.0 * a)})});
  }
  return trajectory;
}

inline Trajectory transformed(const Pose& T, Trajectory trajectory) {
  for (auto& pose : trajectory) {
    pose.pose = T * pose.pose;
  }
  return trajectory;
}

}  // namespace trigpoint::evaluation::test
