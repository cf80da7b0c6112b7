// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Heading from motion: fixes say where the antenna went in map, the gyro how the vehicle turned
// meanwhile; driving forward makes the two comparable.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include "aiding.hpp"
#include <Eigen/Core>

#include <array>
#include <optional>

namespace trigpoint::gps_odometry {

/// Where the antenna was, and how the vehicle stood in a level frame of unknown heading.
struct CoursePoint {
  Nanoseconds stamp_ns{0};
  Eigen::Vector2d antenna_map_m{Eigen::Vector2d::Zero()};
  double sigma_m{0.0};  ///< horizontal, one axis
  double yaw_relative_rad{0.0};
  Eigen::Vector2d lever_relative_m{Eigen::Vector2d::Zero()};  ///< lever arm in the level frame
};

struct HeadingEstimate {
  double yaw_map_relative_rad{0.0};  ///< add to the relative yaw
  double sigma_rad{0.0};
  double speed_mps{0.0};  ///< over the newest leg
  double speed_sigma_mps{0.0};
  /// Heard, not found from motion: then the velocity is this, in map, and not along the heading.
  bool heard{false};
  Eigen::Vector2d velocity_map_mps{Eigen::Vector2d::Zero()};
};

/// Keeps the way of the last points, thinned to legs that say something. Plain data: copied with
/// the states of the rewind buffer.
class HeadingSearch {
 public:
  /// Takes a fix; an estimate once the way is long, fast and certain enough.
  std::optional<HeadingEstimate> add(const CoursePoint& point, const Config& config);

  void restart() { size_ = 0; }

  void change_frame(const Eigen::Matrix2d& R_new_old, const Eigen::Vector2d& t_new_old);

 private:
  static constexpr int kPoints = 24;

  void keep(const CoursePoint& point);

  std::array<CoursePoint, kPoints> points_;
  int size_{0};
};

/// A heading that was heard, for a vehicle that moved by `step_map_m` in `elapsed_s`; nullopt where
/// none was, or the velocity is not known.
std::optional<HeadingEstimate> heard_heading(const AidingState& aiding,
                                             const Eigen::Vector2d& step_map_m,
                                             double elapsed_s,
                                             double sigma_m);

/// Compares a heading that was heard with motion; the way must be several times as long as the one
/// that finds a heading. The estimate by motion when the two contradict each other.
std::optional<HeadingEstimate> contradiction(HeadingSearch& search,
                                             AidingState& aiding,
                                             const CoursePoint& point,
                                             double yaw_sigma_rad,
                                             const Config& config);

}  // namespace trigpoint::gps_odometry
