// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/recording/log.hpp"

#include <functional>
#include <optional>
#include <string>

namespace trigpoint::pipeline {

/// What becomes of a stored session.
enum class UseOfStored {
  kNothing,
  kLocalize,  ///< its map is used as it is; `session` is another folder
  kResume     ///< it is continued: odom, map and datum go on; `session` is its folder
};

struct MapLogOptions {
  std::string session;      ///< folder, created when missing
  std::string config_text;  ///< the effective configuration, kept with the result
  std::string mode;         ///< of the gate, for the report
  /// Share of the log done, 0 to 1; may be empty.
  std::function<void(double)> progress;
  std::function<void(const Event&)> on_event;  ///< may be empty
  /// Asked between entries; true ends the run early, with what was done so far kept.
  std::function<bool()> stop;
  UseOfStored use{UseOfStored::kNothing};
  std::optional<StoredSession> stored;  ///< what `use` is about
};

struct MapLogResult {
  std::uint64_t sweeps_in_log{0};
  std::uint64_t sweeps_used{0};
  double data_s{0.0};
  double wall_s{0.0};
  bool stopped{false};
  std::string log_error;  ///< not empty when the log broke off; what came before was used
};

/// Runs the three cores in lock-step over a log and leaves a session folder without map and report
/// (exporter::render_map and evaluation make those from it). Throws std::runtime_error naming file
/// and cause when the session cannot be written, ConfigError when a core refuses its configuration.
MapLogResult map_log(recording::LogReader& log,
                     const CoreConfigs& configs,
                     const MapLogOptions& options);

}  // namespace trigpoint::pipeline
