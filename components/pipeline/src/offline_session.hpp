// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/serial_worker.hpp"
#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/pipeline/past_beside.hpp"
#include "trigpoint/pipeline/session_parts.hpp"

#include <cstddef>
#include <optional>
#include <string>

namespace trigpoint::pipeline {

/// Everything that an offline run writes. Steps are written on a thread of its own.
class OfflineSession {
 public:
  OfflineSession(const std::string& folder, UseOfStored use);

  /// Before the first step. What is stored may already be there.
  void correct_past_of(Lockstep& cores, UseOfStored use);

  /// Between two steps; `scans` have just been handed to on_step().
  Events after_scans(std::size_t scans) { return past_->after_scans(scans); }

  void on_entry(const recording::LogEntry& entry) { log_.on_entry(entry); }

  /// Returns at once unless the disk lags far behind; throws when it has refused something.
  void on_step(Step&& step, const Lockstep& cores, double step_ms);

  void close(Lockstep& cores, const recording::LogReader& log);

  void keep_truth(const recording::LogReader& log) { log_.keep_truth(log); }

  /// What the parts warn of: before the first step and after close().
  Events take_events();

  const LogPart& log() const { return log_; }

  std::string path(const char* name) const { return exporter::path_in(folder_, name); }

 private:
  void write(const Step& step);
  void keep_datum(const Lockstep& cores);
  void keep_alignment(const Lockstep& cores);

  std::string folder_;
  std::string written_datum_;
  GpsPart gps_;
  MapperPart mapper_;
  GatePart gate_;
  LogPart log_;  ///< written by the caller's thread
  std::optional<PastBeside> past_;
  SerialWorker disk_;  ///< last: its jobs use the others
};

}  // namespace trigpoint::pipeline
