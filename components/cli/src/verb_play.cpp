// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/shell/shell.hpp"
#include "trigpoint/shell/stop_signal.hpp"

#include "bus_guard.hpp"
#include "finish_session.hpp"
#include "input.hpp"
#include "interruption.hpp"
#include "number_checks.hpp"
#include "player.hpp"
#include "progress.hpp"
#include "verbs.hpp"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

namespace trigpoint::cli {

namespace {

struct PlayVerbOptions {
  InputOptions input;
  std::string session;
  std::string rate{"max"};
  int wait_s{10};
  double settle_s{0.0};
  bool check{false};            ///< only look whether a whole run could begin
  bool allow_others{false};     ///< who write the same topics
  bool allow_no_reader{false};  ///< play to nobody
};

/// The player's part of the session; nothing without a folder.
class SessionPart {
 public:
  SessionPart(const std::string& folder, const shell::EventLog& log) : folder_(folder), disk_(log) {
    if (!folder.empty()) {
      exporter::create_session_folder(folder);
      part_.emplace(folder);
    }
  }

  void on_entry(const recording::LogEntry& entry) {
    if (part_) {
      disk_.keep([&] { part_->on_entry(entry); });
    }
  }

  /// What is known before the first message, so that a player that is killed leaves it.
  void begin(const recording::LogReader& reader, const SystemConfig& config) {
    if (part_) {
      disk_.keep([&] {
        write_run(reader, config, 0.0, false);
        part_->keep_truth(reader);
      });
    }
  }

  void close(const recording::LogReader& reader,
             const SystemConfig& config,
             double wall_s,
             bool stopped) {
    if (part_) {
      disk_.keep([&] {
        part_->close(reader);
        write_run(reader, config, wall_s, stopped);
        part_->keep_truth(reader);
      });
    }
  }

  bool failed() const { return disk_.failed(); }

 private:
  void write_run(const recording::LogReader& reader,
                 const SystemConfig& config,
                 double wall_s,
                 bool stopped) const {
    exporter::write_run(exporter::path_in(folder_, exporter::session_file::kRun),
                        {reader.summary().path,
                         "dds",
                         mode_of(config),
                         config.cores.gps_odometry.filter,
                         part_->data_s(),
                         wall_s,
                         stopped,
                         part_->begin_ns(),
                         part_->end_ns()});
  }

  std::string folder_;
  shell::DiskGuard disk_;
  std::optional<pipeline::LogPart> part_;
};

/// 0 when nobody else writes what is going to be written.
int guard_bus(const PlayVerbOptions& options, const SystemConfig& config) {
  if (options.allow_others) {
    return 0;
  }
  const BusFindings findings =
      look_for_writers(config, options.check ? Guarded::kSensorsAndCores : Guarded::kSensors);
  if (findings.interrupted) {
    std::cerr << "trigpoint play: interrupted before the first message\n";
    return kInterrupted;
  }
  if (!findings.writers.empty()) {
    std::cerr << "trigpoint play: " << refusal(findings, config) << "\n";
    return 1;
  }
  return 0;
}

/// The folder may hold the other processes' parts, but not another player's.
void refuse_played_session(const std::string& folder) {
  namespace file = exporter::session_file;
  for (const char* name : {file::kRun, file::kFixes}) {
    if (!folder.empty() && std::filesystem::exists(exporter::path_in(folder, name))) {
      throw ConfigError("--session: " + folder + " holds a player's results already (" + name +
                        "); name another folder, or remove it");
    }
  }
}

int exit_code_of(const recording::PlayResult& result, bool disk_failed) {
  if (!result.log_error.empty()) {
    std::cerr << "trigpoint play: the log breaks off: " << result.log_error << "\n";
    return 1;
  }
  if (result.stopped) {
    std::cerr << "trigpoint play: interrupted; the rest of the log was not played\n";
    return kInterrupted;
  }
  return disk_failed ? 1 : 0;
}

int run(const PlayVerbOptions& options) {
  const double rate = rate_of(options.rate);
  if (options.check) {
    return guard_bus(options, open_input(options.input).config);
  }
  refuse_played_session(options.session);
  const shell::StopSignal stop;
  const shell::EventLog log("play");
  Input input = open_input(options.input);
  if (const int code = guard_bus(options, input.config); code != 0) {
    return code;
  }
  if (!options.session.empty()) {
    leave_truth(input, options.session);
  }
  SessionPart session(options.session, log);
  session.begin(*input.reader, input.config);
  Progress progress("playing");
  recording::PlayOptions play;
  play.robot = input.config.cores.robot;
  play.bus = input.config.bus;
  play.rate = rate;
  play.allow_no_reader = options.allow_no_reader;
  play.wait_for_peers = std::chrono::seconds(options.wait_s);
  play.settle = std::chrono::milliseconds(std::lround(1e3 * options.settle_s));
  play.progress = [&](double share) { progress(share); };
  play.on_entry = [&](const recording::LogEntry& entry) { session.on_entry(entry); };
  play.on_event = [&](const Event& event) { log(event); };
  play.stop = [&] { return stop.requested(); };
  const auto start = std::chrono::steady_clock::now();
  const recording::PlayResult result = recording::play(*input.reader, play);
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  session.close(*input.reader, input.config, wall_s, result.stopped);
  std::cout << "played " << result.sweeps << " sweeps, " << result.imu << " IMU samples, "
            << result.fixes << " fixes in " << wall_s << " s; " << result.unanswered
            << " waits for an answer were given up\n";
  return exit_code_of(result, session.failed());
}

}  // namespace

void add_play(CLI::App& app, Chosen& chosen) {
  CLI::App* verb =
      app.add_subcommand("play", "Publish a log (or a simulated drive) and its clock on the bus");
  const auto options = std::make_shared<PlayVerbOptions>();
  add_input_options(*verb, options->input);
  verb->add_option("--rate",
                   options->rate,
                   "1 is real time; 'max': as fast as mapper and filter take it, dropping nothing")
      ->capture_default_str();
  verb->add_option("--session",
                   options->session,
                   "folder for the player's part of the results (fixes, sweeps, counts, truth)");
  verb->add_option("--wait",
                   options->wait_s,
                   "wait this long for the three processes before the first message, s")
      ->capture_default_str()
      ->check(whole_number());
  verb->add_option(
          "--settle",
          options->settle_s,
          "and then so long again, until those on other computers have heard of the player "
          "too: else they may miss the first messages, s")
      ->capture_default_str()
      ->check(zero_or_more())
      ->check(CLI::Range(0.0, 60.0));
  verb->add_flag("--check",
                 options->check,
                 "play nothing: tell whether arguments, configuration and log are right and nobody "
                 "else writes the topics of a run");
  verb->add_flag("--allow-others",
                 options->allow_others,
                 "also when others write the sensors' topics or the clock");
  verb->add_flag("--allow-no-reader", options->allow_no_reader, "also when nobody listens");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
