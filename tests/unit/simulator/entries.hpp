// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a stream delivers, taken apart for the tests.
#pragma once

#include "trigpoint/simulator/simulator.hpp"

#include <sstream>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint::simulator {

inline std::vector<recording::LogEntry> all_of(recording::LogReader& reader) {
  std::vector<recording::LogEntry> entries;
  while (auto entry = reader.next()) {
    entries.push_back(std::move(*entry));
  }
  return entries;
}

inline std::vector<recording::LogEntry> entries_of(const Scenario& scenario,
                                                   std::uint64_t seed,
                                                   double duration_s,
                                                   bool lidar = true) {
  return all_of(*open_scenario(scenario, seed, duration_s, {lidar}));
}

template <typename Message>
std::vector<Message> messages_of(const std::vector<recording::LogEntry>& entries) {
  std::vector<Message> messages;
  for (const recording::LogEntry& entry : entries) {
    if (const auto* message = std::get_if<Message>(&entry.measurement)) {
      messages.push_back(*message);
    }
  }
  return messages;
}

/// Everything that is in the entry, as bytes.
inline std::string bytes_of(const recording::LogEntry& entry) {
  std::ostringstream out;
  out << std::hexfloat << entry.receive_ns << ' ' << entry.measurement.index() << ' ';
  if (const auto* imu = std::get_if<ImuSample>(&entry.measurement)) {
    out << imu->stamp_ns << ' ' << imu->gyro_radps.transpose() << ' '
        << imu->accel_mps2.transpose();
  } else if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
    out << fix->stamp_ns << ' ' << static_cast<int>(fix->status) << ' ' << fix->latitude_deg << ' '
        << fix->longitude_deg << ' ' << fix->altitude_m << ' '
        << static_cast<int>(fix->covariance_type) << ' ' << fix->covariance_enu_m2;
  } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry.measurement)) {
    out << cloud->stamp_ns << std::string(cloud->data.begin(), cloud->data.end());
  }
  return out.str();
}

inline std::string bytes_of(const std::vector<recording::LogEntry>& entries) {
  std::string bytes;
  for (const recording::LogEntry& entry : entries) {
    bytes += bytes_of(entry) + '\n';
  }
  return bytes;
}

inline double seconds(const Scenario& scenario, Nanoseconds stamp_ns) {
  return to_seconds(stamp_ns - scenario.start_ns());
}

}  // namespace trigpoint::simulator
