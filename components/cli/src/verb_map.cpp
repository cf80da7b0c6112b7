// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/shell/shell.hpp"
#include "trigpoint/shell/stop_signal.hpp"

#include "finish_session.hpp"
#include "input.hpp"
#include "interruption.hpp"
#include "passing_folder.hpp"
#include "progress.hpp"
#include "shell_word.hpp"
#include "told_once.hpp"
#include "verbs.hpp"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>

namespace trigpoint::cli {

namespace {

struct MapOptions {
  InputOptions input;
  std::string out;
  std::string localize;  ///< a session whose map is used as it is
  std::string resume;    ///< a session that is continued
};

/// Throws ConfigError when the options contradict each other or `out` holds something already.
void check(MapOptions& options) {
  if (!options.resume.empty()) {
    if (!options.out.empty() || !options.localize.empty()) {
      throw ConfigError("--resume goes on in its session's folder: leave out --out and --localize");
    }
    options.out = options.resume;
    return;
  }
  if (options.out.empty()) {
    throw ConfigError("--out is missing: the folder for the session");
  }
  refuse_used_folder(options.out);
}

pipeline::UseOfStored use_of(const MapOptions& options) {
  return !options.resume.empty()     ? pipeline::UseOfStored::kResume
         : !options.localize.empty() ? pipeline::UseOfStored::kLocalize
                                     : pipeline::UseOfStored::kNothing;
}

const std::string& stored_session(const MapOptions& options) {
  return options.resume.empty() ? options.localize : options.resume;
}

std::optional<pipeline::StoredSession> stored_of(const MapOptions& options) {
  const std::string& session = stored_session(options);
  return session.empty() ? std::nullopt : std::optional(pipeline::open_stored_session(session));
}

/// The stored map lies about its own datum.
void keep_datum(const std::optional<Datum>& datum, gps_odometry::Config& gps) {
  if (!datum) {
    return;
  }
  Datum configured;
  configured.latitude_deg = gps.datum_latitude_deg;
  configured.longitude_deg = gps.datum_longitude_deg;
  configured.height_m = gps.datum_height_m;
  if (gps.use_configured_datum && configured.id() != datum->id()) {
    throw ConfigError("the configured datum " + configured.id() +
                      " is not that of the stored session, " + datum->id());
  }
  gps.use_configured_datum = true;
  gps.datum_latitude_deg = datum->latitude_deg;
  gps.datum_longitude_deg = datum->longitude_deg;
  gps.datum_height_m = datum->height_m;
}

/// Stamps of a session grow.
void refuse_older_log(const MapOptions& options,
                      const pipeline::StoredSession& stored,
                      const recording::LogSummary& log) {
  if (!options.resume.empty() && log.first_ns != 0 && log.first_ns < stored.checkpoint.stamp_ns) {
    throw ConfigError("--resume: " + log.path + " begins " +
                      std::to_string(to_seconds(stored.checkpoint.stamp_ns - log.first_ns)) +
                      " s before the session ends; only a later log can go on from it");
  }
}

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
    std::cerr << "trigpoint map: "
              << (result.sweeps_in_log == 0
                      ? std::string("no sweep is in the part of the log that was used")
                      : "none of " + std::to_string(result.sweeps_in_log) +
                            " sweeps could be used; the warnings above say why")
              << "\n";
    return 1;
  }
  return 0;
}

/// Where a drive goes that was not found in the map of `session`: beside it, never over another.
std::string folder_apart_from(const std::string& session) {
  const std::string apart = std::filesystem::canonical(session).string() + ".not_resumed";
  std::string folder = apart;
  for (int n = 2; std::filesystem::exists(folder); ++n) {
    folder = apart + "-" + std::to_string(n);
  }
  return folder;
}

struct MapOutcome {
  pipeline::MapLogResult result;
  std::string refused_imu;     ///< the sentence of an IMU that was refused for good while it ran
  bool not_localized{false};   ///< the robot was not found in the map of --localize
  std::string kept_as_it_was;  ///< the session of --resume in whose map it was not found
  std::string why_not_resumed;
  bool stopped_in_trial{false};  ///< by the user; nothing is written
};

/// At once: mapping and report, which follow, may be interrupted.
void tell_not_found(const MapOutcome& outcome, const std::string& out) {
  std::cerr << "trigpoint map: the robot was not found in the stored map ("
            << outcome.why_not_resumed << "). " << outcome.kept_as_it_was
            << " is as it was; the new drive becomes a session of its own, about the same datum: "
            << out << "\n";
}

/// Nothing is written into the session before its place in the map is known. A drive that does not
/// find it becomes a session of its own, about the same datum.
void try_to_resume(MapOptions& options,
                   const SystemConfig& config,
                   const std::function<bool()>& stop,
                   std::optional<pipeline::StoredSession>& stored,
                   MapOutcome& outcome) {
  const Input input = open_input(options.input);
  std::cerr << "looking for the place in the map of " << options.resume << "\n";
  const pipeline::PlaceTrial trial =
      pipeline::try_place(*input.reader, config.cores, *stored, stop);
  outcome.stopped_in_trial = trial.verdict == pipeline::PlaceTrial::Verdict::kStopped;
  if (trial.verdict == pipeline::PlaceTrial::Verdict::kNotFound) {
    outcome.why_not_resumed = trial.why_not;
    outcome.kept_as_it_was = std::exchange(options.resume, {});
    options.out = folder_apart_from(outcome.kept_as_it_was);
    stored.reset();
    tell_not_found(outcome, options.out);
  }
}

MapOutcome map(MapOptions& options) {
  const shell::StopSignal stop;
  const shell::EventLog log("map");
  MapOutcome outcome;
  ToldOnce events([&](const Event& event) {
    log(event);
    if (event.code == "imu_gyro_in_degrees") {
      outcome.refused_imu = event.text;
    }
    if (event.code == "lio_not_resumed") {
      outcome.not_localized = !options.localize.empty();
    }
  });
  const auto stop_is_wanted = [&] { return stop.requested(); };
  std::optional<pipeline::StoredSession> stored = stored_of(options);
  Input input = open_input(options.input);
  if (stored) {
    keep_datum(pipeline::read_stored_datum(stored_session(options)),
               input.config.cores.gps_odometry);
    refuse_older_log(options, *stored, input.reader->summary());
  }
  if (!options.resume.empty()) {
    try_to_resume(options, input.config, stop_is_wanted, stored, outcome);
    if (outcome.stopped_in_trial) {
      return outcome;
    }
  }
  std::optional<PassingFolder> passing;
  leave_truth(input, options.resume.empty() ? options.out : passing.emplace().path());
  {
    Progress progress("mapping");
    outcome.result = pipeline::map_log(*input.reader,
                                       input.config.cores,
                                       {options.out,
                                        print(input.config),
                                        mode_of(input.config),
                                        [&](double share) { progress(share); },
                                        [&](const Event& event) { events(event); },
                                        stop_is_wanted,
                                        use_of(options),
                                        std::move(stored)});
  }
  std::cerr << events.summary();
  return outcome;
}

void tell_not_resumed(const MapOutcome& outcome, const std::string& out) {
  std::cerr << "trigpoint map: the robot was not found in the map of " << outcome.kept_as_it_was
            << ", which is as it was; the new drive is " << out
            << ". One map of both, by GPS and where they meet: trigpoint merge "
            << as_shell_word(outcome.kept_as_it_was) << " " << as_shell_word(out)
            << " --out DIR. Or try --resume again, with a log that begins near the stored "
               "session's last or first place\n";
}

int run(MapOptions& options) {
  check(options);
  const MapOutcome outcome = map(options);
  const pipeline::MapLogResult& result = outcome.result;
  if (outcome.stopped_in_trial) {
    std::cerr << "trigpoint map: interrupted before the place in the stored map was found; "
              << options.resume << " is as it was\n";
    return kInterrupted;
  }
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
  const bool not_resumed = !outcome.kept_as_it_was.empty();
  if (not_resumed) {
    tell_not_resumed(outcome, options.out);
  }
  if (!outcome.refused_imu.empty()) {
    std::cerr << "trigpoint map: " << outcome.refused_imu
              << (outcome.refused_imu.ends_with('.') ? " " : ". ")
              << "What came before is of no use either\n";
    return 1;
  }
  if (outcome.not_localized) {
    std::cerr << "trigpoint map: the robot was not found in the map of " << options.localize
              << ", which is as it was; what came out in " << options.out
              << " is a map of its own, in a new odom epoch\n";
    return 1;
  }
  return std::max({exit_code_of(result), finished, not_resumed ? 1 : 0});
}

}  // namespace

void add_map(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("map",
                                      "Run the three cores in one process over a log: map, "
                                      "trajectories and report, bit-identical on every run");
  const auto options = std::make_shared<MapOptions>();
  add_input_options(*verb, options->input);
  verb->add_option("--out", options->out, "session folder, created when missing");
  verb->add_option(
          "--localize",
          options->localize,
          "a stored session whose map is used and not changed: the robot is looked for near "
          "the session's first and last place; the result, without a map, goes to --out")
      ->check(CLI::ExistingDirectory);
  verb->add_option(
          "--resume",
          options->resume,
          "a stored session that goes on with this log, near its last or first place: same "
          "odom, map and datum, keyframes and trajectories appended; instead of --out. A drive "
          "that does not find its place in the map leaves the session as it is and becomes "
          "one of its own beside it, SESSION.not_resumed, and the exit code is 1")
      ->check(CLI::ExistingDirectory);
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
