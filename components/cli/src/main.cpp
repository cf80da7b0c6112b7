// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"

#include "verbs.hpp"

#include <exception>
#include <iostream>

namespace {

using namespace trigpoint;

int run(const cli::Chosen& chosen) {
  try {
    return chosen();
  } catch (const ConfigError& error) {
    std::cerr << "trigpoint: " << error.what() << "\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "trigpoint: " << error.what() << "\n";
    return 1;
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "GPS-anchored LiDAR-inertial mapping.\n"
      "  trigpoint map LOG --out DIR     a log becomes a georeferenced map, in one process\n"
      "  trigpoint simulate campus --out DIR   a log of a drive that never happened\n"
      "bringup/run does the same over DDS with the three processes.\n"
      "Exit codes: 0 done, 1 failed, 2 wrong usage or configuration.",
      "trigpoint"};
  app.require_subcommand(1);
  app.set_version_flag("--version", TRIGPOINT_VERSION);
  cli::Chosen chosen;
  cli::add_map(app, chosen);
  cli::add_simulate(app, chosen);
  cli::add_info(app, chosen);
  cli::add_play(app, chosen);
  cli::add_record(app, chosen);
  cli::add_evaluate(app, chosen);
  cli::add_report(app, chosen);
  cli::add_export(app, chosen);
  cli::add_config(app, chosen);
  cli::add_doctor(app, chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run(chosen);
}
