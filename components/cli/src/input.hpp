// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/recording/log.hpp"
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "system_config.hpp"
#include "verbs.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::cli {

/// What the command line changes in a scenario, beside the changes behind its name.
struct ScenarioChanges {
  std::int64_t beams{0};  ///< of the LiDAR; 0: the scenario's
  std::optional<double> start_m;
  std::optional<std::int64_t> day;

  bool any() const { return beams != 0 || start_m || day; }
};

struct InputOptions {
  std::string log;  ///< bag, rosbag2, MCAP, KITTI drive, simulated drive's folder, or scenario
  std::vector<std::string> config_files;
  std::string mode;                   ///< of the gate; empty: the configuration's
  std::optional<std::uint64_t> seed;  ///< of a scenario; 1 when left out
  ScenarioChanges changes;            ///< of a scenario
  double duration_s{0.0};             ///< 0: all
  bool lenient{false};                ///< a log that lacks a topic is opened all the same
};

/// A log that is open, and the configuration that goes with it: the user's files over what the log
/// itself knows of its robot over the defaults.
struct Input {
  std::unique_ptr<recording::LogReader> reader;
  SystemConfig config;
  /// Of a scenario: its truth (TUM, for scoring only) goes to a file, whose folder is made. Empty
  /// of a recorded drive. Not after `reader` has gone.
  std::function<void(const std::string& file)> write_truth;
};

/// The arguments --beams, --start and --day.
void add_scenario_options(CLI::App& verb, ScenarioChanges& changes);

/// The argument --storage, of what writes a rosbag2.
void add_storage_option(CLI::App& verb, std::optional<recording::Storage>& storage);

/// The scenario with the changes behind a plus, as load_scenario takes it.
std::string with_changes(const std::string& scenario, const ScenarioChanges& changes);

/// The arguments LOG, --config, --mode, --seed and --duration.
void add_input_options(CLI::App& verb, InputOptions& options);

/// Only --config and --mode.
void add_config_options(CLI::App& verb, InputOptions& options);

/// Throws LogError, and ConfigError when what the user asked for is wrong: no such log, a topic
/// that he named and that is not in it, a seed for a recorded drive, a core's configuration. A
/// scenario is streamed without being written.
Input open_input(const InputOptions& options);

/// The truth of a scenario into `session`, for when all is known to be right and nothing is refused
/// any more; of a recorded drive nothing.
void leave_truth(const Input& input, const std::string& session);

/// The configuration alone, without a log.
SystemConfig load_config_of(const InputOptions& options);

/// Throws ConfigError when a folder for new results holds something already that would be
/// overwritten or mixed with them: a session, a simulated drive, a log.
void refuse_used_folder(const std::string& out);

/// "campus, short, ..."; and the changes behind a plus.
std::string known_scenarios();
std::string known_scenario_changes();

/// Throws ConfigError that lists the scenarios when there is none of that name.
void require_scenario(const std::string& file_or_name);

}  // namespace trigpoint::cli
