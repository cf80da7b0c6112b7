// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the two processes of the vendor matrix have in common: an example of every topic, and
// streams whose every byte follows from a number.
#pragma once

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"

#include <chrono>
#include <string>
#include <vector>

namespace trigpoint::bus::matrix {

inline diagnostic_msgs::msg::DiagnosticArray diagnostics() {
  const Diagnostic one{DiagnosticLevel::kStale, "name", "message", "id", {{"key", "value"}}};
  return to_message(Nanoseconds{8}, std::vector{one, one});
}

inline tf2_msgs::msg::TFMessage transforms() {
  const StampedTransform one{5, "map", "odom", samples::odometry().T_frame_child};
  return to_tf_message(std::vector{one, one});
}

/// Calls `visit(name in topics.hpp, topic, example)` for every topic; matrix_test holds this list
/// against the header.
template <class Visitor>
void visit_topics(Visitor&& visit) {
  visit("points", topics::points, to_message(samples::cloud()));
  visit("imu", topics::imu, to_message(samples::imu()));
  visit("fix", topics::fix, to_message(samples::fix()));
  visit("twist", topics::twist, to_message(samples::twist()));
  visit("twist_odometry", topics::twist_odometry, to_odometry_message(samples::twist()));
  visit("yaw", topics::yaw, to_message(samples::yaw()));
  visit("clock", topics::clock, to_clock_message(1'700'000'000'000'000'009));
  visit("gps_odometry", topics::gps_odometry, to_message(samples::odometry()));
  visit("gps_status", topics::gps_status, to_message(samples::gps_status()));
  visit("gps_selected", topics::gps_selected, to_message(samples::odometry()));
  visit("lio_odometry", topics::lio_odometry, to_message(samples::odometry()));
  visit("lio_odometry_imu_rate", topics::lio_odometry_imu_rate, to_message(samples::odometry()));
  visit("lio_status", topics::lio_status, to_message(samples::lio_status()));
  visit("state_update", topics::state_update, to_message(samples::state_update()));
  visit("fusion_odometry", topics::fusion_odometry, to_message(samples::odometry()));
  visit("fusion_odometry_raw", topics::fusion_odometry_raw, to_message(samples::odometry()));
  visit("fusion_status", topics::fusion_status, to_message(samples::fusion_status()));
  visit("datum", topics::datum, to_message(samples::datum()));
  visit("cloud_registered", topics::cloud_registered, to_message(samples::cloud()));
  visit("map", topics::map, to_message(samples::cloud()));
  visit("tf", topics::tf, transforms());
  visit("tf_static", topics::tf_static, transforms());
  visit("diagnostics", topics::diagnostics, diagnostics());
  visit("clock_probe", topics::clock_probe, diagnostics());
}

// ---- streams ------------------------------------------------------------------------------------
// Number 0 is repeated until the reader has heard it on both topics; then it subscribes to
// `kBegin`, and 1, 2, ... follow once each.

inline constexpr auto kBegin = topics::diagnostics;
inline constexpr std::uint32_t kClouds = 50;
inline constexpr std::chrono::milliseconds kCloudPeriod{100};
inline constexpr std::uint32_t kImuSamples = 2000;
inline constexpr std::chrono::microseconds kImuPeriod{2500};
inline constexpr std::size_t kCloudBytes = 3'000'000;

/// Of the writer when it publishes, for the latency: both processes have the same clock.
inline Nanoseconds wall_clock_now_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::nanoseconds(now).count();
}

inline ImuSample numbered_imu(std::uint32_t number) {
  ImuSample imu = samples::imu();
  imu.stamp_ns = 0;
  imu.gyro_radps.x() = number;
  imu.accel_mps2.z() = -0.125 * number;
  return imu;
}

inline std::uint32_t number_of(const ImuSample& imu) {
  return static_cast<std::uint32_t>(imu.gyro_radps.x());
}

inline PointCloudMessage numbered_cloud(std::uint32_t number, std::size_t bytes) {
  PointCloudMessage cloud = samples::cloud();
  cloud.stamp_ns = 0;
  cloud.height = number;
  cloud.data.resize(bytes);
  for (std::size_t i = 0; i < bytes; ++i) {
    cloud.data[i] = static_cast<std::uint8_t>((i * 7 + i / 251) ^ number);
  }
  return cloud;
}

}  // namespace trigpoint::bus::matrix
