// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/map_log.hpp"

#include "trigpoint/base/serial_worker.hpp"
#include "trigpoint/export/session.hpp"

#include "offline_session.hpp"
#include "read_ahead.hpp"

#include <chrono>
#include <memory>
#include <utility>

namespace trigpoint::pipeline {

namespace {

namespace file = exporter::session_file;
using Clock = std::chrono::steady_clock;

/// Entries that a run beside others may be behind the reader: two to six sweeps.
constexpr std::size_t kBehind = 64;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

void tell(const Events& events, const std::function<void(const Event&)>& on_event) {
  if (on_event) {
    for (const Event& event : events) {
      on_event(event);
    }
  }
}

/// The robot is looked for near the session's last and first place.
void go_on_from(const StoredSession& stored, UseOfStored use, Lockstep& cores) {
  lio_mapper::ResumeOptions options;
  options.frozen_map = use == UseOfStored::kLocalize;
  if (stored.first_pose) {
    options.more_places_odom.push_back(*stored.first_pose);
  }
  cores.resume(stored.checkpoint, stored.points, options);
}

/// "odom epoch 2 begins: WHY"; no epoch begins in a trial.
std::string why_of(const Event& not_resumed) {
  const std::string colon = ": ";
  const std::size_t at = not_resumed.text.find(colon);
  return at == std::string::npos ? not_resumed.text : not_resumed.text.substr(at + colon.size());
}

/// What a step says of the place in the stored map; nothing while the search goes on.
std::optional<PlaceTrial> verdict_of(const Step& step) {
  for (const Event& event : step.events) {
    if (event.code == "lio_resumed") {
      return PlaceTrial{PlaceTrial::Verdict::kFound, ""};
    }
    if (event.code == "lio_not_resumed") {
      return PlaceTrial{PlaceTrial::Verdict::kNotFound, why_of(event)};
    }
  }
  return std::nullopt;
}

/// The cores on a log, and the session that they leave. For one thread at a time.
class MapRun {
 public:
  /// The session's folder is made and its first files are written.
  MapRun(const recording::LogReader& log, const CoreConfigs& configs, const MapLogOptions& options)
      : options_(options),
        filter_(configs.gps_odometry.filter),
        log_path_(log.summary().path),
        cores_(configs),
        withholding_(options.withhold) {
    resume();
    exporter::create_session_folder(options_.session);
    if (options_.use == UseOfStored::kResume) {
      before_ = exporter::runs_in(options_.session);
    }
    session_.emplace(options_.session, options_.use);
    session_->correct_past_of(cores_, options_.use);
    session_->keep_truth(log);
    tell(session_->take_events(), options_.on_event);
    exporter::write_text(session_->path(file::kConfig), options_.config_text);
    start_ = Clock::now();
    write_run();  // a run that is killed says at least what it was
  }

  void take(recording::LogEntry entry, std::optional<lio_mapper::DecodedCloud> cloud) {
    if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      entry.withheld = withholding_.withholds(fix->stamp_ns) || entry.withheld;
    }
    session_->on_entry(entry);
    if (const auto begin_ns = session_->log().begin_ns(); begin_ns != begin_ns_) {
      begin_ns_ = begin_ns;
      write_run();  // so that one that is killed says where it begins
    }
    advance([&] { return cloud ? cores_.step(entry, std::move(*cloud)) : cores_.step(entry); });
  }

  /// The rest; `log` has been read as far as it was.
  MapLogResult finish(recording::LogReader& log, bool stopped, const std::string& log_error) {
    advance([&] { return cores_.finish(); });
    tell(log.take_events(), options_.on_event);
    tell(recording::undecodable_events(log), options_.on_event);
    session_->close(cores_, log);
    tell(session_->take_events(), options_.on_event);
    result_.stopped = stopped;
    result_.log_error = log_error;
    result_.sweeps_in_log = session_->log().sweeps();
    // The mapper of a resumed session counts on from what it had used before.
    const bool resumed = options_.stored && options_.use == UseOfStored::kResume;
    result_.sweeps_used = cores_.lio_status().scans_used -
                          (resumed ? options_.stored->checkpoint.scans_used : std::uint64_t{0});
    result_.data_s = session_->log().data_s();
    result_.wall_s = milliseconds_since(start_) * 1e-3;
    write_run();
    return result_;
  }

 private:
  void resume() {
    if (!options_.stored || options_.use == UseOfStored::kNothing) {
      return;
    }
    go_on_from(*options_.stored, options_.use, cores_);
  }

  template <typename Advance>
  void advance(const Advance& step_of_cores) {
    const Clock::time_point before = Clock::now();
    Step step = step_of_cores();
    const double step_ms = milliseconds_since(before);
    tell(step.events, options_.on_event);
    const std::size_t scans = step.scans.size();
    session_->on_step(std::move(step), cores_, step_ms);
    tell(session_->after_scans(scans), options_.on_event);
  }

  void write_run() const {
    exporter::write_run(session_->path(file::kRun),
                        {log_path_,
                         "offline",
                         options_.mode,
                         filter_,
                         result_.data_s,
                         result_.wall_s,
                         result_.stopped,
                         begin_ns_,
                         session_->log().end_ns(),
                         before_});
  }

  MapLogOptions options_;
  std::string filter_;
  std::string log_path_;
  Lockstep cores_;
  recording::FixWithholding withholding_;
  std::optional<OfflineSession> session_;
  std::vector<exporter::RunInfo> before_;  ///< of a session that goes on
  std::optional<Nanoseconds> begin_ns_;    ///< of the IMU's first stamp
  Clock::time_point start_;
  MapLogResult result_;
};

struct Reading {
  bool stopped{false};
  /// Why the log broke off. None when stopped: it may have been beyond what the runs were given.
  std::string error;
};

/// Hands over the log's entries one by one, their clouds decoded. `options` are those of one run or
/// of several.
template <typename Options, typename Take>
Reading read_all(recording::LogReader& log,
                 const lio_mapper::Config& config,
                 const Options& options,
                 const Take& take) {
  tell(recording::fault_events(log.summary()), options.on_event);
  Reading reading;
  ReadAhead ahead(log, config);
  while (auto item = ahead.next()) {
    tell(item->events, options.on_event);
    const double progress = item->progress;
    take(std::move(*item));
    if (options.progress) {
      options.progress(progress);
    }
    if (options.stop && options.stop()) {
      reading.stopped = true;
      break;
    }
  }
  ahead.stop();
  reading.error = reading.stopped ? "" : ahead.error();
  return reading;
}

/// A run with a thread of its own.
struct RunBeside {
  MapRun run;
  SerialWorker worker{kBehind};  ///< last: its jobs use the run

  RunBeside(const recording::LogReader& log,
            const CoreConfigs& configs,
            const MapLogOptions& options)
      : run(log, configs, options) {}
};

}  // namespace

PlaceTrial try_place(recording::LogReader& log,
                     const CoreConfigs& configs,
                     const StoredSession& stored,
                     const std::function<bool()>& stop) {
  Lockstep cores(configs);
  go_on_from(stored, UseOfStored::kResume, cores);
  try {
    while (const auto entry = log.next()) {
      if (stop && stop()) {
        return {PlaceTrial::Verdict::kStopped, ""};
      }
      if (auto verdict = verdict_of(cores.step(*entry))) {
        return *verdict;
      }
    }
  } catch (const recording::LogError& broken) {
    return {PlaceTrial::Verdict::kNotFound, std::string("the log breaks off: ") + broken.what()};
  }
  return verdict_of(cores.finish())
      .value_or(PlaceTrial{PlaceTrial::Verdict::kNotFound,
                           "the log ended before the search for the place did"});
}

MapLogResult map_log(recording::LogReader& log,
                     const CoreConfigs& configs,
                     const MapLogOptions& options) {
  MapRun run(log, configs, options);
  const Reading reading = read_all(log, configs.lio_mapper, options, [&](ReadAhead::Item&& item) {
    run.take(std::move(item.entry), std::move(item.decoded));
  });
  return run.finish(log, reading.stopped, reading.error);
}

std::vector<MapLogResult> map_log_side_by_side(recording::LogReader& log,
                                               const std::vector<RunOfMany>& runs,
                                               const SideBySideOptions& options) {
  std::vector<std::unique_ptr<RunBeside>> beside;
  for (const RunOfMany& run : runs) {
    beside.push_back(std::make_unique<RunBeside>(log, run.configs, run.options));
  }
  const Reading reading =
      read_all(log, runs.at(0).configs.lio_mapper, options, [&](ReadAhead::Item&& read) {
        const auto item = std::make_shared<const ReadAhead::Item>(std::move(read));
        for (const auto& each : beside) {
          each->worker.give([&run = each->run, item] { run.take(item->entry, item->decoded); });
        }
      });
  std::vector<MapLogResult> results;
  for (const auto& each : beside) {
    each->worker.finish();
    results.push_back(each->run.finish(log, reading.stopped, reading.error));
  }
  return results;
}

}  // namespace trigpoint::pipeline
