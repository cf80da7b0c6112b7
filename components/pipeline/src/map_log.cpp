// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/map_log.hpp"

#include "trigpoint/base/serial_worker.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/past_beside.hpp"
#include "trigpoint/pipeline/session_parts.hpp"

#include "read_ahead.hpp"

#include <chrono>
#include <optional>
#include <utility>

namespace trigpoint::pipeline {

namespace {

namespace file = exporter::session_file;
using Clock = std::chrono::steady_clock;

/// Two and a half seconds of IMU samples, with the scans and fixes between them.
constexpr std::size_t kUnwrittenSteps = 256;
/// Five seconds at 10 Hz from a snapshot of the past to its correction, however long that takes.
constexpr std::uint64_t kAdoptAfterScans = 50;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

exporter::Opening opening_for(UseOfStored use) {
  return use == UseOfStored::kResume ? exporter::Opening::kContinue : exporter::Opening::kFresh;
}

/// Everything that an offline run writes.
class Session {
 public:
  Session(const std::string& folder, UseOfStored use)
      : folder_(folder),
        gps_(folder, opening_for(use)),
        mapper_(folder,
                use == UseOfStored::kResume     ? Continuing::kYes
                : use == UseOfStored::kLocalize ? Continuing::kNoStore
                                                : Continuing::kNo),
        gate_(folder, opening_for(use)),
        log_(folder, opening_for(use)) {}

  /// Before the first step. What is stored may already be there.
  void correct_past_of(Lockstep& cores, UseOfStored use) {
    past_.emplace(
        cores.mapper(),
        path(file::kKeyframes),
        use == UseOfStored::kResume ? stored_past(folder_) : lio_mapper::GraphInput{},
        [this](SerialWorker::Job job) { disk_.give(std::move(job)); },
        PastBesideOptions{kAdoptAfterScans, 0});
  }

  /// Between two steps; `scans` have just been handed to on_step().
  Events after_scans(std::size_t scans) { return past_->after_scans(scans); }

  void on_entry(const recording::LogEntry& entry) { log_.on_entry(entry); }

  /// Returns at once unless the disk lags far behind; throws when it has refused something.
  void on_step(Step&& step, const Lockstep& cores, double step_ms) {
    for (lio_mapper::ScanResult& scan : step.scans) {
      scan.status.scan_ms += step_ms / static_cast<double>(step.scans.size());
    }
    keep_datum(cores);
    const bool judged = !step.fusion_status.empty();
    if (judged || !step.gps_odometry.empty() || !step.gps_status.empty() || !step.scans.empty() ||
        !step.fused.empty()) {
      disk_.give([this, step = std::move(step)] { write(step); });
    }
    if (judged) {
      keep_alignment(cores);
    }
  }

  void close(Lockstep& cores, const recording::LogReader& log) {
    past_->cancel();
    keep_datum(cores);
    keep_alignment(cores);
    disk_.finish();
    gps_.keep_counts(cores.gps_status());
    mapper_.close(cores.lio_status(), cores.checkpoint(), cores.take_rows());
    gate_.close();
    log_.close(log);
  }

  void keep_truth(const recording::LogReader& log) const { log_.keep_truth(log); }

  const LogPart& log() const { return log_; }

  std::string path(const char* name) const { return exporter::path_in(folder_, name); }

 private:
  void write(const Step& step) {
    for (const Odometry& odometry : step.gps_odometry) {
      gps_.on_odometry(odometry);
    }
    for (const GpsStatus& status : step.gps_status) {
      gps_.on_status(status);
    }
    for (const lio_mapper::ScanResult& scan : step.scans) {
      mapper_.on_scan(scan);
    }
    for (const Odometry& fused : step.fused) {
      gate_.on_fused(fused);
    }
    for (const FusionStatus& status : step.fusion_status) {
      gate_.on_status(status);
    }
  }

  /// As soon as there is one: a run that is killed keeps its georeference.
  void keep_datum(const Lockstep& cores) {
    const auto datum = cores.datum();
    if (datum && datum->id() != written_datum_) {
      written_datum_ = datum->id();
      disk_.give([this, datum] { gps_.on_datum(*datum); });
    }
  }

  void keep_alignment(const Lockstep& cores) {
    if (const auto alignment = cores.best_alignment()) {
      disk_.give([this, alignment, aligned = cores.lio_status().aligned] {
        gate_.on_alignment(*alignment, aligned);
      });
    }
  }

  std::string folder_;
  std::string written_datum_;
  GpsPart gps_;
  MapperPart mapper_;
  GatePart gate_;
  LogPart log_;  ///< written by the caller's thread
  std::optional<PastBeside> past_;
  SerialWorker disk_{kUnwrittenSteps};  ///< last: its jobs use the others
};

void tell(const Events& events, const MapLogOptions& options) {
  if (options.on_event) {
    for (const Event& event : events) {
      options.on_event(event);
    }
  }
}

}  // namespace

MapLogResult map_log(recording::LogReader& log,
                     const CoreConfigs& configs,
                     const MapLogOptions& options) {
  Lockstep cores(configs);
  if (options.stored && options.use != UseOfStored::kNothing) {
    lio_mapper::ResumeOptions resume;
    resume.frozen_map = options.use == UseOfStored::kLocalize;
    if (options.stored->first_pose) {
      resume.more_places_odom.push_back(*options.stored->first_pose);
    }
    cores.resume(options.stored->checkpoint, options.stored->points, resume);
  }
  exporter::create_session_folder(options.session);
  Session session(options.session, options.use);
  session.correct_past_of(cores, options.use);
  exporter::write_text(session.path(file::kConfig), options.config_text);
  session.keep_truth(log);
  const Clock::time_point start = Clock::now();
  MapLogResult result;
  const auto write_run = [&] {
    exporter::write_run(session.path(file::kRun),
                        {log.summary().path,
                         "offline",
                         options.mode,
                         configs.gps_odometry.filter,
                         result.data_s,
                         result.wall_s,
                         result.stopped});
  };
  write_run();  // a run that is killed says at least what it was

  const auto run = [&](auto&& advance) {
    const Clock::time_point before = Clock::now();
    Step step = advance();
    const double step_ms = milliseconds_since(before);
    tell(step.events, options);
    const std::size_t scans = step.scans.size();
    session.on_step(std::move(step), cores, step_ms);
    tell(session.after_scans(scans), options);
  };
  tell(recording::fault_events(log.summary()), options);
  ReadAhead ahead(log, configs.lio_mapper);
  while (auto item = ahead.next()) {
    tell(item->events, options);
    session.on_entry(item->entry);
    run([&] {
      return item->decoded ? cores.step(item->entry, std::move(*item->decoded))
                           : cores.step(item->entry);
    });
    if (options.progress) {
      options.progress(item->progress);
    }
    if (options.stop && options.stop()) {
      result.stopped = true;
      break;
    }
  }
  ahead.stop();
  if (!result.stopped) {
    result.log_error = ahead.error();  // else perhaps of what this run never reached
  }
  run([&] { return cores.finish(); });
  tell(log.take_events(), options);
  tell(recording::undecodable_events(log), options);
  session.close(cores, log);

  result.sweeps_in_log = session.log().sweeps();
  // The mapper of a resumed session counts on from what it had used before.
  const bool resumed = options.stored && options.use == UseOfStored::kResume;
  result.sweeps_used = cores.lio_status().scans_used -
                       (resumed ? options.stored->checkpoint.scans_used : std::uint64_t{0});
  result.data_s = to_seconds(session.log().last_ns() - session.log().first_ns());
  result.wall_s = milliseconds_since(start) * 1e-3;
  write_run();
  return result;
}

}  // namespace trigpoint::pipeline
