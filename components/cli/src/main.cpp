// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"

#include "verbs.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <optional>
#include <string>

namespace {

using namespace trigpoint;

int run(const cli::Chosen& chosen) {
  try {
    return chosen();
  } catch (const ConfigError& error) {
    std::cerr << "trigpoint: " << error.what() << "\n";
    return 2;
  } catch (const std::bad_alloc&) {
    std::cerr << "trigpoint: there is not enough memory for this\n";
    return 1;
  } catch (const std::exception& error) {
    std::cerr << "trigpoint: " << error.what() << "\n";
    return 1;
  }
}

/// What was printed may still wait in a buffer that the disk refuses.
bool output_was_written() {
  std::cout.flush();
  return std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
}

bool has_verb(const CLI::App& app, const std::string& name) {
  const auto verbs = app.get_subcommands({});
  return std::any_of(
      verbs.begin(), verbs.end(), [&name](const auto* verb) { return verb->get_name() == name; });
}

/// The first word that is no option, when it is no verb.
std::optional<std::string> unknown_verb(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-' || has_verb(app, argv[1])) {
    return std::nullopt;
  }
  return argv[1];
}

int refuse_verb(const CLI::App& app, const std::string& name) {
  std::cerr << "trigpoint: there is no verb '" << name << "'; there are:";
  for (const CLI::App* verb : app.get_subcommands({})) {
    std::cerr << " " << verb->get_name();
  }
  std::cerr << "\n";
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "GPS-anchored LiDAR-inertial mapping.\n"
      "  trigpoint map LOG --out DIR     a log becomes a georeferenced map, in one process\n"
      "  trigpoint simulate campus --out DIR   a log of a drive that never happened\n"
      "bringup/run does the same over DDS with the three processes.\n"
      "Exit codes: 0 done, 1 failed, 2 wrong usage or configuration, 130 interrupted (Ctrl-C).",
      "trigpoint"};
  app.require_subcommand(1);
  app.set_version_flag("--version", TRIGPOINT_VERSION);
  cli::Chosen chosen;
  cli::add_map(app, chosen);
  cli::add_simulate(app, chosen);
  cli::add_info(app, chosen);
  cli::add_play(app, chosen);
  cli::add_record(app, chosen);
  cli::add_live(app, chosen);
  cli::add_evaluate(app, chosen);
  cli::add_report(app, chosen);
  cli::add_reproduce(app, chosen);
  cli::add_export(app, chosen);
  cli::add_merge(app, chosen);
  cli::add_gps_plots(app, chosen);
  cli::add_config(app, chosen);
  cli::add_doctor(app, chosen);
  if (const auto name = unknown_verb(app, argc, argv)) {
    return refuse_verb(app, *name);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  const int code = run(chosen);
  if (!output_was_written()) {
    std::cerr << "trigpoint: standard output could not be written; is the disk full?\n";
    return std::max(code, 1);
  }
  return code;
}
