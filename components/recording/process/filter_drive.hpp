// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Drives a GPS filter that runs on the bus through a log, and writes down what it says.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/recording/log.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::recording {

/// A message with its writer and the data time that had been reached when it came.
template <class T>
struct Heard {
  T message;
  std::string writer;
  Nanoseconds reached_ns{0};
};

struct FilterRecord {
  std::vector<Heard<Odometry>> odometry;
  std::vector<Heard<GpsStatus>> statuses;
  std::vector<Heard<Datum>> datums;
  std::uint64_t imu{0};
  std::uint64_t fixes{0};
  std::uint64_t unanswered{0};  ///< fixes after which no gps/status came in time
  bool stopped{false};
};

struct FilterDriveOptions {
  RobotConfig robot;
  bus::Config bus;
  double rate{5.0};  ///< data seconds per wall second, at most
  std::chrono::milliseconds patience{1000};
  std::chrono::seconds wait_for_filter{10};
  std::function<void(const Event&)> on_event;  ///< may be empty
  std::function<void(double)> progress;        ///< may be empty
  std::function<bool()> stop;                  ///< may be empty
};

/// Publishes imu/data, gps/fix and clock; after every fix it waits for the filter's gps/status, so
/// that a busy computer makes it slower and not the filter worse. Throws std::runtime_error when
/// the bus cannot be joined or nobody listens to both sensors.
FilterRecord drive_filter(LogReader& log, const FilterDriveOptions& options);

/// The datum that somebody on the bus holds, if any.
std::optional<Datum> hear_datum(const bus::Config& config, std::chrono::milliseconds wait);

}  // namespace trigpoint::recording
