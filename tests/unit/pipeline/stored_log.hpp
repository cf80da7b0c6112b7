// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A short simulated drive, made once for all tests of the binary, and a reader of stored entries.
#pragma once

#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/recording/log.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <limits>
#include <variant>
#include <vector>

namespace trigpoint::pipeline {

using Entries = std::vector<recording::LogEntry>;

struct StoredDrive {
  CoreConfigs configs;
  Entries entries;
};

/// Two seconds at rest, then eleven metres: enough for an alignment with the settings below.
inline const StoredDrive& stored_drive() {
  static const StoredDrive drive = [] {
    const auto scenario = simulator::load_scenario("short");
    const auto reader = simulator::open_scenario(scenario, 1, 7.0);
    StoredDrive made;
    made.configs.robot = *reader->robot();
    made.configs.gps_odometry.use_configured_datum = true;
    made.configs.gps_odometry.datum_latitude_deg = scenario.datum.latitude_deg;
    made.configs.gps_odometry.datum_longitude_deg = scenario.datum.longitude_deg;
    made.configs.gps_odometry.datum_height_m = scenario.datum.height_m;
    made.configs.fusion_gate.alignment.max_yaw_sigma_rad = 0.1;
    while (auto entry = reader->next()) {
      made.entries.push_back(std::move(*entry));
    }
    return made;
  }();
  return drive;
}

template <typename Kind>
bool holds(const recording::LogEntry& entry) {
  return std::holds_alternative<Kind>(entry.measurement);
}

template <typename Kind>
std::uint64_t count(const Entries& entries) {
  std::uint64_t n = 0;
  for (const recording::LogEntry& entry : entries) {
    n += holds<Kind>(entry) ? 1U : 0U;
  }
  return n;
}

/// Gives the entries; breaks off after `intact` of them when that is fewer.
class StoredLog final : public recording::LogReader {
 public:
  explicit StoredLog(const Entries& entries,
                     std::size_t intact = std::numeric_limits<std::size_t>::max())
      : entries_(entries), intact_(intact) {
    summary_.path = "stored";
  }

  const recording::LogSummary& summary() const override { return summary_; }

  std::optional<recording::LogEntry> next() override {
    if (at_ == intact_) {
      throw recording::LogError("stored: torn off");
    }
    return at_ < entries_.size() ? std::optional(entries_[at_++]) : std::nullopt;
  }

  double progress() const override {
    return static_cast<double>(at_) / static_cast<double>(entries_.size());
  }

 private:
  const Entries& entries_;
  std::size_t intact_;
  std::size_t at_{0};
  recording::LogSummary summary_;
};

}  // namespace trigpoint::pipeline
