// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/scenario.hpp"

#include "bus_guard.hpp"
#include "input.hpp"
#include "verbs.hpp"

#include <iostream>
#include <memory>
#include <string>

namespace trigpoint::cli {

namespace {

struct ConfigVerbOptions {
  InputOptions input;
  bool check{false};
};

int run(const ConfigVerbOptions& options) {
  const SystemConfig config =
      options.input.log.empty() ? load_config_of(options.input) : open_input(options.input).config;
  if (options.check) {
    check_cores(config);
    const std::string joined = try_to_join(config);  // throws: before half a line is printed
    std::cout << "right; joins " << joined << "\n";
  } else {
    std::cout << print(config);
  }
  return 0;
}

}  // namespace

void add_config(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand(
      "config",
      "Print the effective configuration: defaults, --for LOG's own robot, --config files");
  const auto options = std::make_shared<ConfigVerbOptions>();
  add_config_options(*verb, options->input);
  verb->add_option(
      "--for", options->input.log, "a log (or scenario) whose own calibration is taken over");
  verb->add_flag("--check",
                 options->check,
                 "print one line instead: whether every process could start with this "
                 "configuration, and which DDS domain (ROS_DOMAIN_ID) and vendor that would be");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
