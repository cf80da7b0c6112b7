// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {

/// What one input caused. Stamps of `odometry` never go back.
struct Output {
  std::optional<Odometry> odometry;  ///< base_link in map
  std::optional<GpsStatus> status;   ///< after every fix and once a second of data time
  std::optional<Datum> elected;      ///< this filter has just elected the datum
  Events events;
};

/// NavSatFix + IMU -> position odometry with covariance in `map`. Deterministic, single-threaded,
/// no clock: data time is what the inputs' stamps say. Never throws on data; every refused input is
/// counted with its reason in GpsStatus::rejections.
class GpsOdometry {
 public:
  /// Throws ConfigError when the configuration contradicts itself.
  GpsOdometry(const Config& config, const RobotConfig& robot);
  ~GpsOdometry();

  Output on_imu(const ImuSample& sample);
  /// Late fixes are applied at their own stamp (rewind buffer).
  Output on_fix(const GnssFix& fix);
  /// Optional: velocity of the vehicle in base_link's axes, and its heading. Late ones are applied
  /// at their own stamp; only events come back.
  Output on_twist(const TwistMeasurement& twist);
  Output on_yaw(const YawMeasurement& yaw);
  /// Adopts a datum that somebody else elected (or configuration gave); an older election replaces
  /// the present one and is announced as a reset.
  Output on_datum(const Datum& datum);

  /// Warm start: another filter's gps/odometry, about the datum `datum_id`. A freshly started
  /// filter begins there, inflated, when it hears one no later than a second after its first usable
  /// IMU sample; afterwards this does nothing.
  Output on_odometry(const Odometry& odometry, const std::string& datum_id);
  bool wants_odometry() const;

  std::optional<Datum> datum() const;

  /// The newest status, also between fixes.
  GpsStatus status() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::gps_odometry
