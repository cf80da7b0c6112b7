// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Finds a gyro that speaks in degrees a second by what the accelerometer and common sense forbid.
#pragma once

#include "trigpoint/base/time.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <deque>
#include <optional>
#include <string>

namespace trigpoint {

/// Two contradictions within about a second, neither of which a robot on the ground reaches:
/// - it would turn on average by more than a full turn a second (a gyro in deg/s says so from a
/// real
///   0.11 rad/s on);
/// - it would tilt by more than 60 degrees, while the specific force, which is about gravity all
/// the
///   time, keeps its direction within 20 degrees (a gyro in deg/s says so from a real 1 degree on).
/// Vibration averages out of both. A robot that neither turns nor tilts is not found out; nor need
/// it be, as a gyro of zero is zero in every unit.
class GyroUnitCheck {
 public:
  /// One sample, in any axes that stay the same. A sentence with the numbers and the remedy from
  /// the first contradiction on, for every later sample, too.
  const std::optional<std::string>& add(Nanoseconds stamp_ns,
                                        const Eigen::Vector3d& gyro_radps,
                                        const Eigen::Vector3d& accel_mps2);

 private:
  /// A fifth of a second.
  struct Block {
    Nanoseconds begin_ns{0};
    Nanoseconds end_ns{0};
    int samples{0};
    Eigen::Vector3d turned_rad{Eigen::Vector3d::Zero()};  ///< sum of rate times interval
    Eigen::Quaterniond q_begin_end{Eigen::Quaterniond::Identity()};
    Eigen::Vector3d force_sum_mps2{Eigen::Vector3d::Zero()};

    Eigen::Vector3d mean_force_mps2() const { return force_sum_mps2 / samples; }
  };

  void judge();
  void judge_rate();
  void judge_tilt();

  std::deque<Block> blocks_;  ///< the last one is being filled
  Nanoseconds last_ns_{0};
  std::optional<std::string> contradiction_;
};

}  // namespace trigpoint
