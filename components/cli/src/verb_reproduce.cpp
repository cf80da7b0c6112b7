// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/reproduction.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/shell/shell.hpp"
#include "trigpoint/shell/stop_signal.hpp"

#include "interruption.hpp"
#include "number_checks.hpp"
#include "progress.hpp"
#include "reproduce_drives.hpp"
#include "told_once.hpp"
#include "verbs.hpp"

#include <filesystem>
#include <iostream>
#include <memory>
#include <mutex>

namespace trigpoint::cli {

namespace {

namespace fs = std::filesystem;
namespace file = exporter::session_file;

/// The first warning of each kind, from whichever run has it first.
class Warnings {
 public:
  Warnings() : log_("reproduce"), told_([this](const Event& event) { log_(event); }) {}

  void operator()(const Event& event) {
    if (event.severity != Severity::kInfo) {
      const std::lock_guard<std::mutex> lock(mutex_);
      told_(event);
    }
  }

  std::string summary() const { return told_.summary(); }

 private:
  std::mutex mutex_;
  shell::EventLog log_;
  ToldOnce told_;
};

/// They are what a map would be made of, and nearly all of what a session weighs.
void remove_keyframes(const evaluation::ReproducedDrive& drive) {
  for (const evaluation::ModeSessions& mode : drive.modes) {
    for (const std::string& session : {mode.fed, mode.withheld}) {
      if (!session.empty()) {
        fs::remove(exporter::path_in(session, file::kKeyframes));
      }
    }
  }
}

/// All modes over one log. False when the user stopped it.
bool run_drive(const DriveToRun& drive,
               const ReproduceOptions& options,
               const shell::StopSignal& stop,
               std::vector<std::string>& problems) {
  const std::string folder = exporter::path_in(options.out, drive.about.name);
  const Input input = open_input(drive.input);
  leave_truth(input, folder);
  Warnings warnings;
  std::vector<pipeline::RunOfMany> runs =
      runs_of(drive, input.config, {options.withhold_every_s, options.withhold_for_s});
  for (pipeline::RunOfMany& run : runs) {
    run.options.on_event = [&warnings](const Event& event) { warnings(event); };
  }
  std::vector<pipeline::MapLogResult> results;
  {
    Progress progress(drive.about.name + ", " + std::to_string(runs.size()) + " runs");
    results = pipeline::map_log_side_by_side(*input.reader,
                                             runs,
                                             {[&](double share) { progress(share); },
                                              [&](const Event& event) { warnings(event); },
                                              [&] { return stop.requested(); }});
  }
  std::cerr << warnings.summary();
  if (!options.keep_keyframes) {
    remove_keyframes(drive.about);
  }
  const pipeline::MapLogResult& first = results.front();
  if (!first.log_error.empty()) {
    problems.push_back("The log breaks off (" + first.log_error +
                       "); the figures are of what came before.");
  }
  return !first.stopped;
}

std::string how(const ReproduceOptions& options, const DriveToRun& any) {
  const SystemConfig config = load_config_of(any.input);
  std::string text = "Made by `trigpoint reproduce` (" TRIGPOINT_VERSION "); GPS filter `" +
                     config.cores.gps_odometry.filter + "`.";
  if (const double duration_s = any.input.duration_s; duration_s > 0.0) {
    text += " **Only the first " + std::to_string(std::llround(duration_s)) +
            " s of each drive, not the drives.**";
  }
  if (!options.no_withheld) {
    text += " Withheld: the last " + std::to_string(std::llround(options.withhold_for_s)) +
            " s of every " + std::to_string(std::llround(options.withhold_every_s)) +
            " s of fixes.";
  }
  return text;
}

void tell(const evaluation::Reproduction& result, const ReproduceOptions& options) {
  std::cout << evaluation::print(result);
  for (const char* name :
       {"reproduction.html", "reproduction.md", "reproduction.csv", "reproduction.json"}) {
    std::cout << exporter::path_in(options.out, name) << "\n";
  }
  for (const std::string& failure : evaluation::failures_of(result)) {
    std::cerr << "trigpoint reproduce: " << failure << "\n";
  }
}

int run(const ReproduceOptions& options) {
  const shell::StopSignal stop;
  const std::vector<DriveToRun> drives = drives_of(options);
  evaluation::Reproduction result;
  result.how = how(options, drives.front());
  for (const DriveToRun& drive : drives) {
    result.missing.push_back(drive.about.name);
  }
  evaluation::write(result, options.out);  // a run that is killed is seen to be incomplete
  for (const DriveToRun& drive : drives) {
    std::vector<std::string> problems;
    if (!run_drive(drive, options, stop, problems)) {
      tell(result, options);
      std::cerr << "trigpoint reproduce: interrupted in " << drive.about.name
                << "; the drives that were done are in " << options.out << "\n";
      return kInterrupted;
    }
    evaluation::DriveFigures figures = evaluation::score(drive.about);
    figures.problems.insert(figures.problems.begin(), problems.begin(), problems.end());
    evaluation::draw(figures, options.out);
    result.drives.push_back(std::move(figures));
    result.missing.erase(result.missing.begin());
    evaluation::write(result, options.out);
  }
  tell(result, options);
  return evaluation::failures_of(result).empty() ? 0 : 1;
}

void add_what(CLI::App& verb, ReproduceOptions& options) {
  verb.add_option("--drives",
                  options.drives,
                  "scenarios to drive, with changes if wanted (campus+wrong_fix); long_drive has "
                  "three dropouts, as the paper's Fig. 11")
      ->delimiter(',')
      ->capture_default_str();
  verb.add_option("--park", options.park, "LIO-SAM's park_dataset.bag: read with its preset")
      ->check(CLI::ExistingPath);
  verb.add_option("--small-campus",
                  options.small_campus,
                  "LIO-SAM's small_campus_dataset.bag: read with its preset")
      ->check(CLI::ExistingPath);
  verb.add_flag("--no-simulated", options.no_simulated, "only the bags");
  verb.add_option("--modes", options.modes, "of the gate")
      ->delimiter(',')
      ->check(CLI::IsMember({"lio", "fusion", "literal", "hard", "smooth"}))
      ->capture_default_str();
  verb.add_option("--seed", options.seed, "of the scenarios' world and noise")
      ->check(whole_number())
      ->capture_default_str();
  verb.add_flag("--quick", options.quick, "only the first 60 s of each drive");
  verb.add_option("--duration", options.duration_s, "only this much of each drive, s")
      ->check(more_than_zero());
}

void add_how(CLI::App& verb, ReproduceOptions& options) {
  verb.add_option("--config", options.config_files, "YAML over the presets; may be repeated");
  verb.add_flag("--published-ekf",
                options.published_ekf,
                "as GPS filter the published EKF with LIO-SAM's settings (preset lio_sam_ekf)");
  verb.add_option("--withhold-every", options.withhold_every_s, "s; see --withhold-for")
      ->check(more_than_zero())
      ->capture_default_str();
  verb.add_option("--withhold-for",
                  options.withhold_for_s,
                  "in a second run of each mode nobody is given the last so many seconds of fixes "
                  "of every --withhold-every; they are scored against")
      ->check(more_than_zero())
      ->capture_default_str();
  verb.add_flag("--no-withheld", options.no_withheld, "no second runs: half the time");
  verb.add_flag("--keep-keyframes",
                options.keep_keyframes,
                "keep each session's keyframes, of which trigpoint report makes its map");
}

}  // namespace

void add_reproduce(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("reproduce",
                                      "The paper's comparison (its Table I, Fig. 7 to 11) in "
                                      "every mode of the gate: table, page, pictures");
  const auto options = std::make_shared<ReproduceOptions>();
  verb->add_option("--out,--output", options->out, "folder for everything that is made")
      ->capture_default_str();
  add_what(*verb, *options);
  add_how(*verb, *options);
  verb->footer("docs/reproducing_the_paper.md says what the figures are.");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
