// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Puts a log on the bus.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/recording/log.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace trigpoint::recording {

struct PlayOptions {
  RobotConfig robot;
  bus::Config bus;
  /// Data seconds per wall second; 0: as fast as the mapper and the filter take it, so that nothing
  /// is dropped: the next sweep waits until the mapper has done the last one, and after a fix the
  /// GPS filter's answer is awaited.
  double rate{0.0};
  /// Waits this long for a mapper, a filter and a gate before the first message.
  std::chrono::seconds wait_for_peers{10};
  /// And then so long again, so that they know us too: a reader on another computer that learns of
  /// a writer late never asks for what went before.
  std::chrono::milliseconds settle{0};
  bool allow_no_reader{false};  ///< play on when nobody at all listens
  /// An answer that does not come within this time is given up, counted and told.
  std::chrono::milliseconds patience{3000};
  std::function<void(double)> progress;           ///< may be empty
  std::function<void(const LogEntry&)> on_entry;  ///< before it is published; may be empty
  std::function<void(const Event&)> on_event;     ///< may be empty
  std::function<bool()> stop;                     ///< may be empty
};

struct PlayResult {
  std::uint64_t sweeps{0};
  std::uint64_t imu{0};
  std::uint64_t fixes{0};
  std::uint64_t unanswered{0};  ///< sweeps and fixes that nobody answered in time
  bool stopped{false};
  std::string log_error;  ///< not empty when the log broke off
};

/// Publishes points, imu/data, gps/fix (under the names in `robot`), twists and yaws where `robot`
/// has topics for them, and clock. Throws std::runtime_error when the bus cannot be joined, when
/// nobody listens (unless that is allowed), or when two mappers or two gates do, whose results
/// would be mixed.
PlayResult play(LogReader& log, const PlayOptions& options);

}  // namespace trigpoint::recording
