// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

struct Output {
  std::vector<StateUpdate> state_updates;  ///< for the mapper, in order
  std::optional<Odometry> fused;           ///< base_link in map; none before the alignment
  std::optional<Odometry> fused_raw;       ///< the same before the hand-over; with it
  std::optional<Odometry> selected;        ///< the GPS odometry that is followed
  std::optional<FusionStatus> status;
  Events events;
};

/// The arbiter: aligns map and odom, decides axis by axis (Algorithm I of the paper) which source
/// updates the state, and says why. Deterministic, single-threaded, no clock. `writer` tells GPS
/// sources apart (GUID on the bus).
class FusionGate {
 public:
  /// Throws ConfigError when the configuration contradicts itself.
  FusionGate(const Config& config, const RobotConfig& robot);
  ~FusionGate();

  Output on_gps_odometry(const Odometry& odometry, const std::string& writer);
  Output on_gps_status(const GpsStatus& status, const std::string& writer);
  Output on_fix(const GnssFix& fix);
  /// A heading of robot.yaw_topic: a prior of the first alignment.
  Output on_yaw(const YawMeasurement& yaw);
  Output on_datum(const Datum& datum);
  Output on_lio_odometry(const Odometry& odometry);
  Output on_lio_odometry_imu_rate(const Odometry& odometry);
  Output on_lio_status(const LioStatus& status);

  /// The best alignment known at this moment, admitted or not; with its covariance.
  std::optional<Alignment> best_alignment() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::fusion_gate
