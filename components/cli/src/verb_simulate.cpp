// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "progress.hpp"
#include "verbs.hpp"

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
};

std::string known_scenarios() {
  std::string names;
  for (const std::string& name : simulator::shipped_scenarios()) {
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

int run(const SimulateOptions& options) {
  const simulator::Scenario scenario = simulator::load_scenario(options.scenario);
  std::optional<double> duration_s;
  if (options.duration_s > 0.0) {
    duration_s = options.duration_s;
  }
  {
    Progress progress("simulating");
    simulator::simulate(scenario,
                        options.seed,
                        duration_s,
                        options.out,
                        [&](double share) { progress(share); },
                        {!options.no_lidar});
  }
  std::cout << options.out << ": log (rosbag2), truth.tum, scenario.yaml, robot.yaml\n"
            << "next: trigpoint map " << options.out << " --out SESSION\n";
  return 0;
}

}  // namespace

void add_simulate(CLI::App& app, Chosen& chosen) {
  CLI::App* verb =
      app.add_subcommand("simulate", "Write the log of a drive through a world that is known");
  const auto options = std::make_shared<SimulateOptions>();
  verb->add_option("SCENARIO", options->scenario, "a .yaml file, or one of: " + known_scenarios())
      ->required();
  verb->add_option("--seed", options->seed, "of the world and of the noise")->capture_default_str();
  verb->add_option("--duration", options->duration_s, "s; the scenario's own when left out")
      ->check(CLI::NonNegativeNumber);
  verb->add_option("--out", options->out, "folder, created when missing; must not hold a log yet")
      ->required();
  verb->add_flag("--no-lidar", options->no_lidar, "IMU and GPS only, at a hundred times real time");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
