// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Optional inputs: the velocity of the vehicle (wheels) and its heading (base/heading.hpp). What
// the former must be before it comes near the filter.
#pragma once

#include "trigpoint/base/heading.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace trigpoint::gps_odometry {

/// A velocity that may be used, in base_link's axes.
struct CheckedTwist {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d velocity_base_mps{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_m2ps2{Eigen::Matrix3d::Identity()};  ///< wide where nothing is known
};

struct TwistVerdict {
  std::optional<CheckedTwist> measurement;  ///< nullopt: refused
  std::string reason;                       ///< name of the counter
  std::string text;
};

TwistVerdict check_twist(const TwistMeasurement& twist, const Config& config);

/// Part of a Track: what aiding has done and what it waits for.
struct AidingState {
  Nanoseconds twist_ns{0};  ///< of the newest one judged
  int twists_refused{0};    ///< in a row
  Nanoseconds twist_distrusted_until_ns{0};
  Nanoseconds yaw_ns{0};
  /// Heading heard while there was none: add to the relative yaw of the search.
  bool has_prior{false};
  double prior_yaw_map_relative_rad{0.0};
  double prior_sigma_rad{0.0};
  /// The heading rests on such a measurement and motion has not confirmed it yet.
  bool heading_unproven{false};
  /// Motion has contradicted it: not heard again before this.
  Nanoseconds yaw_distrusted_until_ns{0};
};

/// Notes whether a twist passed the gate. After many in a row that did not, wheels are not heard
/// for a while: one that slips passes now and then by chance.
bool passes_gate(AidingState& aiding, Nanoseconds stamp_ns, double distance2, double gate);

}  // namespace trigpoint::gps_odometry
