// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A filter that is up and running, for tests of what comes then.
#pragma once

#include "drive.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

inline constexpr double kRtkTolerance_m = 0.10;

inline Sensors rtk_robot() {
  Sensors sensors;
  sensors.robot.antenna_position_base_m = {0.35, 0.15, 0.6};
  sensors.gyro_bias_radps = {0.002, -0.002, 0.003};
  sensors.accel_bias_mps2 = {0.05, -0.03, 0.05};
  return sensors;
}

/// A filter that has driven for 20 s; what it is told then is up to the test.
struct Driven {
  explicit Driven(const std::string& name = "ekf15")
      : truth(drive(town(1.5, 3.0), 60.0)),
        inputs(sense(truth, rtk_robot(), 1)),
        filter(config_with_datum(name), rtk_robot().robot) {
    advance(20.0);
  }

  /// Feeds the inputs until `time_s`; `change` may alter a fix or drop it (false).
  template <typename Change>
  void advance(double time_s, const Change& change) {
    for (; next < inputs.size() && inputs[next].available_s < time_s; ++next) {
      Input input = inputs[next];
      if (input.is_fix && !change(input.fix)) {
        continue;
      }
      take(input.is_fix ? filter.on_fix(input.fix) : filter.on_imu(input.imu));
    }
  }

  void advance(double time_s) {
    advance(time_s, [](GnssFix&) { return true; });
  }

  void take(const Output& output) {
    if (output.status) {
      status = *output.status;
    }
    if (output.odometry) {
      EXPECT_TRUE(output.odometry->T_frame_child.is_finite());
      EXPECT_TRUE(output.odometry->pose_covariance.allFinite());
      odometry = *output.odometry;
    }
    events.insert(events.end(), output.events.begin(), output.events.end());
  }

  double time_s() const { return to_seconds(odometry.stamp_ns - kEpoch_ns); }

  double error_m() const {
    const auto index = static_cast<std::size_t>(std::lround(time_s() * 1000.0));
    return (odometry.T_frame_child.p - truth.at(index).position_map_m).norm();
  }

  std::vector<Truth> truth;
  std::vector<Input> inputs;
  GpsOdometry filter;
  std::size_t next{0};
  GpsStatus status;
  Odometry odometry;
  Events events;
};

inline bool has_event(const Events& events, const std::string& code) {
  return std::any_of(
      events.begin(), events.end(), [&](const Event& event) { return event.code == code; });
}

}  // namespace trigpoint::gps_odometry
