// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/shell.hpp"

#include "input.hpp"
#include "live_view.hpp"
#include "verbs.hpp"

#include <iostream>
#include <memory>

namespace trigpoint::cli {

namespace {

struct LiveVerbOptions {
  InputOptions input;
  live::ServerOptions server;
};

int run(const LiveVerbOptions& options) {
  const SystemConfig config = load_config_of(options.input);
  const shell::EventLog log("live");
  live::LiveViewOptions view;
  view.robot = config.cores.robot;
  view.bus = config.bus;
  view.server = options.server;
  view.on_event = [&log](const Event& event) { log(event); };
  view.on_listening = [&](std::uint16_t port) {
    std::cout << "DDS domain " << bus::domain_of(config.bus)
              << " is shown at http://localhost:" << port
              << "/ and, for Foxglove and Lichtblick, at ws://localhost:" << port
              << "; Ctrl-C ends it" << std::endl;
  };
  const live::Counters counters = live::run_live_view(view);
  std::cout << "sent " << counters.sent << " messages to browsers; " << counters.dropped
            << " were left out for browsers that were too slow" << std::endl;
  return 0;
}

}  // namespace

void add_live(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("live", "Show a running system in a browser, until Ctrl-C");
  const auto options = std::make_shared<LiveVerbOptions>();
  verb->add_option(
          "--port", options->server.port, "of the page and the WebSocket; 0 takes a free one")
      ->capture_default_str();
  verb->add_option("--bind",
                   options->server.bind_address,
                   "IP address to listen on; 0.0.0.0 lets every computer of the network look on")
      ->capture_default_str();
  verb->add_option("--max-clients", options->server.max_clients, "connections that are let in")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  verb->add_option("--config", options->input.config_files, "YAML with the keys to change");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
