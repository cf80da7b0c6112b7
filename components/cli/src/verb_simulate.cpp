// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/stop_signal.hpp"
#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "input.hpp"
#include "interruption.hpp"
#include "number_checks.hpp"
#include "progress.hpp"
#include "shell_word.hpp"
#include "verbs.hpp"

#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

namespace trigpoint::cli {

namespace {

struct SimulateOptions {
  std::string scenario;
  std::uint64_t seed{1};
  double duration_s{0.0};
  std::string out;
  bool no_lidar{false};
  ScenarioChanges changes;
  std::optional<recording::Storage> storage;
};

/// Thrown out of the simulation between two messages: the log is closed on the way.
struct DriveInterrupted {};

void simulate(const SimulateOptions& options,
              const simulator::Scenario& scenario,
              std::optional<double> duration_s) {
  const shell::StopSignal stop;
  Progress progress("simulating");
  const auto tell_or_stop = [&](double share) {
    if (stop.requested()) {
      throw DriveInterrupted();
    }
    progress(share);
  };
  try {
    simulator::simulate(scenario,
                        options.seed,
                        duration_s,
                        options.out,
                        tell_or_stop,
                        {!options.no_lidar, {}},
                        options.storage.value_or(recording::Storage::kSqlite3));
  } catch (const std::exception&) {
    std::error_code not_empty;
    std::filesystem::remove(options.out, not_empty);  // leaves whatever is in it
    throw;
  }
}

int run(const SimulateOptions& options) {
  require_scenario(options.scenario);
  const simulator::Scenario scenario =
      simulator::load_scenario(with_changes(options.scenario, options.changes));
  const std::optional<double> duration_s = scenario_duration_s(options.duration_s);
  refuse_used_folder(options.out);
  refuse_used_folder((std::filesystem::path(options.out) / "log").string());
  try {
    simulate(options, scenario, duration_s);
  } catch (const DriveInterrupted&) {
    std::cerr << "trigpoint simulate: interrupted; " << options.out
              << "/log is whole up to there and can be used\n";
    return kInterrupted;
  }
  std::cout << options.out << ": log (rosbag2, "
            << (options.storage == recording::Storage::kMcap ? "mcap" : "sqlite3")
            << "), truth.tum, scenario.yaml, robot.yaml\n"
            << "next: trigpoint map " << as_shell_word(options.out) << " --out SESSION\n";
  return 0;
}

}  // namespace

void add_simulate(CLI::App& app, Chosen& chosen) {
  CLI::App* verb =
      app.add_subcommand("simulate", "Write the log of a drive through a world that is known");
  const auto options = std::make_shared<SimulateOptions>();
  verb->add_option(
          "SCENARIO",
          options->scenario,
          "a .yaml file, or one of: " + known_scenarios() +
              "; SCENARIO+CHANGE+... alters it, as in campus+beams_64+motion.start_m=50: a "
              "CHANGE is a .yaml file, KEY=VALUE, or one of: " +
              known_scenario_changes())
      ->required();
  verb->add_option("--seed", options->seed, "of the world and of the noise")
      ->capture_default_str()
      ->check(whole_number());
  add_scenario_options(*verb, options->changes);
  verb->add_option("--duration", options->duration_s, "s; the scenario's own when left out")
      ->check(more_than_zero());
  verb->add_option("--out", options->out, "folder, created when missing; must not hold results yet")
      ->required();
  add_storage_option(*verb, options->storage);
  verb->add_flag("--no-lidar", options->no_lidar, "IMU and GPS only, at a hundred times real time");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
