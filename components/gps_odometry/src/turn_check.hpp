// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include <Eigen/Core>

#include <deque>
#include <optional>
#include <string>

namespace trigpoint::gps_odometry {

struct TurnVerdict {
  std::string reason;  ///< empty: no fault
  std::string text;
};

/// Turns of the gyro against turns of the course that fixes show, leg by leg: opposite signs show
/// after two or three corners. Reversing turns the course round, but not its changes; a change of
/// gear is left out.
class TurnCheck {
 public:
  void add_imu(Nanoseconds stamp_ns,
               const Eigen::Vector3d& gyro_radps,
               const Eigen::Vector3d& up_base);

  TurnVerdict add_fix(Nanoseconds stamp_ns, const Eigen::Vector2d& antenna_map_m, double sigma_m);

  void restart();

 private:
  struct Yaw {
    Nanoseconds stamp_ns;
    double yaw_rad;  ///< by the gyro alone, not wrapped
  };

  struct Point {
    Nanoseconds stamp_ns;
    Eigen::Vector2d antenna_map_m;
    double yaw_rad;
  };

  struct Leg {
    double course_rad;
    double yaw_rad;  ///< in its middle
  };

  std::optional<double> yaw_at(Nanoseconds stamp_ns) const;
  TurnVerdict judge();

  std::optional<Nanoseconds> imu_ns_;
  double yaw_rad_{0.0};
  std::deque<Yaw> yaws_;
  std::optional<Point> newest_;
  std::optional<Point> last_;  ///< where the leg began
  bool has_stood_{false};      ///< since then
  std::optional<Leg> leg_;
  double turned_rad_{0.0};
  double course_course_{0.0};
  double gyro_course_{0.0};
  double gyro_gyro_{0.0};
};

}  // namespace trigpoint::gps_odometry
