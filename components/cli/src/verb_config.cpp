// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/scenario.hpp"

#include "input.hpp"
#include "verbs.hpp"

#include <iostream>
#include <memory>

namespace trigpoint::cli {

void add_config(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand(
      "config",
      "Print the effective configuration: defaults, --for LOG's own robot, --config files");
  const auto options = std::make_shared<InputOptions>();
  add_config_options(*verb, *options);
  verb->add_option(
      "--for", options->log, "a log (or scenario) whose own calibration is taken over");
  verb->callback([options, &chosen] {
    chosen = [options] {
      std::cout << print(options->log.empty() ? load_config_of(*options)
                                              : open_input(*options).config);
      return 0;
    };
  });
}

}  // namespace trigpoint::cli
