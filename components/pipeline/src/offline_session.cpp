// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "offline_session.hpp"

#include "trigpoint/export/session.hpp"

#include <utility>

namespace trigpoint::pipeline {

namespace {

namespace file = exporter::session_file;

/// Two and a half seconds of IMU samples, with the scans and fixes between them.
constexpr std::size_t kUnwrittenSteps = 256;
/// Five seconds at 10 Hz from a snapshot of the past to its correction, however long that takes.
constexpr std::uint64_t kAdoptAfterScans = 50;

exporter::Opening opening_for(UseOfStored use) {
  return use == UseOfStored::kResume ? exporter::Opening::kContinue : exporter::Opening::kFresh;
}

}  // namespace

OfflineSession::OfflineSession(const std::string& folder, UseOfStored use)
    : folder_(folder),
      gps_(folder, opening_for(use)),
      mapper_(folder,
              use == UseOfStored::kResume     ? Continuing::kYes
              : use == UseOfStored::kLocalize ? Continuing::kNoStore
                                              : Continuing::kNo),
      gate_(folder, opening_for(use)),
      log_(folder, opening_for(use)),
      disk_(kUnwrittenSteps) {}

void OfflineSession::correct_past_of(Lockstep& cores, UseOfStored use) {
  past_.emplace(
      cores.mapper(),
      path(file::kKeyframes),
      use == UseOfStored::kResume ? stored_past(folder_) : lio_mapper::GraphInput{},
      [this](SerialWorker::Job job) { disk_.give(std::move(job)); },
      PastBesideOptions{kAdoptAfterScans, 0});
}

void OfflineSession::on_step(Step&& step, const Lockstep& cores, double step_ms) {
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

void OfflineSession::close(Lockstep& cores, const recording::LogReader& log) {
  past_->cancel();
  keep_datum(cores);
  keep_alignment(cores);
  disk_.finish();
  gps_.keep_counts(cores.gps_status());
  mapper_.close(cores.lio_status(), cores.checkpoint(), cores.take_rows());
  gate_.close();
  log_.close(log);
}

Events OfflineSession::take_events() {
  Events all = gps_.take_events();
  for (const Events& events : {gate_.take_events(), log_.take_events()}) {
    all.insert(all.end(), events.begin(), events.end());
  }
  return all;
}

void OfflineSession::write(const Step& step) {
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
void OfflineSession::keep_datum(const Lockstep& cores) {
  const auto datum = cores.datum();
  if (datum && datum->id() != written_datum_) {
    written_datum_ = datum->id();
    disk_.give([this, datum] { gps_.on_datum(*datum); });
  }
}

void OfflineSession::keep_alignment(const Lockstep& cores) {
  disk_.give([this, best = cores.best_alignment(), aligned = cores.lio_status().aligned] {
    gate_.on_alignment(best, aligned);
  });
}

}  // namespace trigpoint::pipeline
