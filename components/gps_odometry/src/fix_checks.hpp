// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a fix must be before it comes near the filter: research/gps.md table E.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/geodesy/local_frame.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace trigpoint::gps_odometry {

/// A fix that may be used, with the covariance that it is worth.
struct CheckedFix {
  Nanoseconds stamp_ns{0};
  geodesy::Geographic place;
  Eigen::Matrix3d covariance_enu_m2{Eigen::Matrix3d::Identity()};  ///< scaled, symmetric, positive
  GnssClass gnss_class{GnssClass::kUnknown};
  bool assumed_covariance{false};  ///< the receiver sent none
  double stamp_sigma_s{0.0};       ///< where its clock is not the IMU's
};

struct FixVerdict {
  std::optional<CheckedFix> fix;  ///< nullopt: refused
  std::string reason;             ///< name of the counter; of a repair when the fix may be used
  std::string text;               ///< a sentence with the value and what was expected
};

/// Checks of one message by itself: numbers, status, place, covariance.
FixVerdict check_fix(const GnssFix& fix, const Config& config);

/// Counts positions that repeat bit by bit: a receiver or driver that is stuck.
class FrozenReceiver {
 public:
  /// How often this place came in a row, this time included.
  std::int64_t count(const geodesy::Geographic& place);

 private:
  geodesy::Geographic last_;
  std::int64_t repeats_{0};
};

}  // namespace trigpoint::gps_odometry
