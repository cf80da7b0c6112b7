// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A freshly started filter may begin where another one's gps/odometry left off: position, heading
// and velocity, inflated for their age and for what the other one may not know of itself.
#pragma once

#include "trigpoint/base/messages.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace trigpoint::gps_odometry {

/// base_link at one moment as it may be taken over; errors of the blocks are independent.
struct WarmState {
  Nanoseconds stamp_ns{0};
  Pose T_map_base;
  Eigen::Vector3d linear_base_mps{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d position_covariance_m2{Eigen::Matrix3d::Identity()};     ///< axes of map
  Eigen::Matrix3d rotation_covariance_rad2{Eigen::Matrix3d::Identity()};   ///< about axes of map
  Eigen::Matrix3d velocity_covariance_m2ps2{Eigen::Matrix3d::Identity()};  ///< axes of base_link
};

/// Why an odometry cannot be taken over, as a sentence; nullopt when it can.
std::optional<std::string> find_warm_start_fault(const Odometry& odometry,
                                                 const std::string& odometry_datum_id,
                                                 const std::string& own_datum_id);

/// The odometry carried to `now_ns` with its own twist; nullopt when it is older than a few seconds
/// or newer than now by more than that is worth.
std::optional<WarmState> carry_to(const Odometry& odometry, Nanoseconds now_ns);

/// Collects what is heard and says when listening ends.
class WarmStartListener {
 public:
  /// Keeps the newest odometry.
  void hear(const Odometry& odometry, const std::string& datum_id);

  /// Data time goes on; listening ends a second after the first usable IMU sample.
  void advance(Nanoseconds now_ns);

  void close() { open_ = false; }

  bool is_open() const { return open_; }

  /// Why what was heard is not taken; told when listening ends.
  std::string fault;

  struct Heard {
    Odometry odometry;
    std::string datum_id;
  };

  const std::optional<Heard>& heard() const { return heard_; }

 private:
  bool open_{true};
  std::optional<Nanoseconds> began_ns_;
  std::optional<Heard> heard_;
};

}  // namespace trigpoint::gps_odometry
