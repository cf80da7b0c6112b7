// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/shell/shell.hpp"
#include "trigpoint/shell/stop_signal.hpp"

#include "finish_session.hpp"
#include "input.hpp"
#include "interruption.hpp"
#include "progress.hpp"
#include "told_once.hpp"
#include "verbs.hpp"

#include <algorithm>
#include <iostream>
#include <memory>

namespace trigpoint::cli {

namespace {

struct MapOptions {
  InputOptions input;
  std::string out;
};

int exit_code_of(const pipeline::MapLogResult& result) {
  if (!result.log_error.empty()) {
    std::cerr << "trigpoint map: the log breaks off: " << result.log_error
              << "; what came before is in the session\n";
    return 1;
  }
  if (result.stopped) {
    return kInterrupted;
  }
  if (result.sweeps_used == 0) {
    std::cerr << "trigpoint map: none of " << result.sweeps_in_log
              << " sweeps could be used; the warnings above say why\n";
    return 1;
  }
  return 0;
}

/// `refused_imu` becomes the sentence of an IMU that was refused for good while it ran.
pipeline::MapLogResult map(const MapOptions& options, std::string& refused_imu) {
  const shell::StopSignal stop;
  const shell::EventLog log("map");
  ToldOnce events([&](const Event& event) {
    log(event);
    if (event.code == "imu_gyro_in_degrees") {
      refused_imu = event.text;
    }
  });
  Input input =
      open_input(options.input, exporter::path_in(options.out, exporter::session_file::kTruth));
  pipeline::MapLogResult result;
  {
    Progress progress("mapping");
    result = pipeline::map_log(*input.reader,
                               input.config.cores,
                               {options.out,
                                print(input.config),
                                mode_of(input.config),
                                [&](double share) { progress(share); },
                                [&](const Event& event) { events(event); },
                                [&] { return stop.requested(); }});
  }
  std::cerr << events.summary();
  return result;
}

int run(const MapOptions& options) {
  refuse_used_folder(options.out);
  std::string refused_imu;
  const pipeline::MapLogResult result = map(options, refused_imu);
  if (result.stopped) {
    std::cerr << "trigpoint map: interrupted after " << result.data_s
              << " s of the log; what was done so far is kept in " << options.out
              << ", its map and report follow\n";
  }
  const LastWords last_words(
      "\ntrigpoint map: interrupted before the report was done; trigpoint "
      "report " +
      options.out + " finishes it\n");
  const int finished = finish_session(options.out);
  std::cout << result.sweeps_used << " of " << result.sweeps_in_log << " sweeps used, "
            << result.data_s << " s of data in " << result.wall_s << " s ("
            << result.data_s / std::max(result.wall_s, 1e-9) << " x real time)\n";
  if (!refused_imu.empty()) {
    std::cerr << "trigpoint map: " << refused_imu << ". What came before is of no use either\n";
    return 1;
  }
  return std::max(exit_code_of(result), finished);
}

}  // namespace

void add_map(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("map",
                                      "Run the three cores in one process over a log: map, "
                                      "trajectories and report, bit-identical on every run");
  const auto options = std::make_shared<MapOptions>();
  add_input_options(*verb, options->input);
  verb->add_option("--out", options->out, "session folder, created when missing")->required();
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
