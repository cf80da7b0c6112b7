// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The one seam between GpsOdometry, which is the same for all filters, and a filter with its rewind
// buffer. Another filter is another tracker and one more line in make_filter.
#pragma once

#include "trigpoint/base/robot.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include "imu_checks.hpp"
#include "track.hpp"
#include "warm_start.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace trigpoint::gps_odometry {

class Filter {
 public:
  virtual ~Filter() = default;

  /// Name of the filter in GpsStatus::source.
  virtual const char* source() const = 0;

  virtual void insert(const CheckedImu& imu) = 0;
  /// The fix must be neither too old nor a duplicate.
  virtual FixOutcome insert(const MapFix& fix) = 0;
  virtual FixOutcome insert(const CheckedTwist& twist) = 0;
  virtual FixOutcome insert(const Heading& yaw) = 0;
  virtual bool is_too_old(Nanoseconds stamp_ns) const = 0;
  virtual bool has_fix_at(Nanoseconds stamp_ns) const = 0;
  /// What is held of the fixes that a late one can still change, by stamp.
  virtual std::vector<FixRecord> recent_fixes() const = 0;
  virtual std::optional<Nanoseconds> newest_imu_ns() const = 0;

  /// An IMU that was silent until this stamp goes on without a new start.
  virtual bool bridges_gap_until(Nanoseconds stamp_ns) const = 0;
  virtual void restart() = 0;
  virtual void change_frame(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t_new_old) = 0;
  virtual void announce_reset(const YawPose& delta) = 0;
  /// The newest state goes on from here; what was measured before is forgotten.
  virtual void warm_start(const WarmState& state) = 0;

  // Of the newest state.
  virtual const Track& newest() const = 0;
  virtual Estimate estimate() const = 0;
  virtual double speed_mps() const = 0;
  virtual double yaw_sigma_rad() const = 0;
  virtual bool is_doubtful() const = 0;
};

/// The filter that `config.filter` names; throws ConfigError when there is none.
std::unique_ptr<Filter> make_filter(const Config& config, const RobotConfig& robot);

}  // namespace trigpoint::gps_odometry
