// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/recording/fix_withholding.hpp"
#include "trigpoint/recording/log.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

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
  /// Fixes that no core is given, beside those that the log marks; the session holds them.
  recording::FixWithholding withhold{};
};

struct MapLogResult {
  std::uint64_t sweeps_in_log{0};
  std::uint64_t sweeps_used{0};
  double data_s{0.0};
  double wall_s{0.0};
  bool stopped{false};
  std::string log_error;  ///< not empty when the log broke off; what came before was used
};

/// Whether a log's robot is found in a stored map.
struct PlaceTrial {
  enum class Verdict { kFound, kNotFound, kStopped };
  Verdict verdict{Verdict::kNotFound};
  std::string why_not;  ///< of kNotFound
};

/// Feeds the cores a log until the mapper has found its place in `stored`, or given that up, and
/// writes nothing: a map_log with kResume over the same log comes to the same verdict, with the
/// same bits, and goes on. The log is read as far as that takes. `stop` as in MapLogOptions. Throws
/// ConfigError when a core refuses its configuration, and what `stored` throws when it is read.
PlaceTrial try_place(recording::LogReader& log,
                     const CoreConfigs& configs,
                     const StoredSession& stored,
                     const std::function<bool()>& stop = {});

/// Runs the three cores in lock-step over a log and leaves a session folder without map and report
/// (exporter::render_map and evaluation make those from it). Throws std::runtime_error naming file
/// and cause when the session cannot be written, ConfigError when a core refuses its configuration.
MapLogResult map_log(recording::LogReader& log,
                     const CoreConfigs& configs,
                     const MapLogOptions& options);

/// One of several runs over the same log. `options.progress` and `options.stop` are those of all,
/// in SideBySideOptions; `options.on_event` is called on a thread of the run's own.
struct RunOfMany {
  CoreConfigs configs;
  MapLogOptions options;
};

struct SideBySideOptions {
  std::function<void(double)> progress;
  std::function<void(const Event&)> on_event;  ///< of the log
  std::function<bool()> stop;
};

/// map_log of each run, in the order given, while the log is read (or made) once only. Every run
/// has a thread of its own and leaves the bytes that it leaves alone. The clouds are decoded with
/// the first run's configuration: lio_mapper.sweep must be the same in all. Throws as map_log does;
/// what the other runs have written stays.
std::vector<MapLogResult> map_log_side_by_side(recording::LogReader& log,
                                               const std::vector<RunOfMany>& runs,
                                               const SideBySideOptions& options);

}  // namespace trigpoint::pipeline
