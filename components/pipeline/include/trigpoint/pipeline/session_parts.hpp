// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The part of the session folder that each program writes. The offline run holds all of them; on
// the bus each process holds its own, so that nothing needs a shared disk. All throw
// std::runtime_error naming file and cause when the disk refuses; what was written before stays
// valid.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/recording/log.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::pipeline {

/// gps.tum, gps_status.csv, datum.yaml and the filter's counts.
class GpsPart {
 public:
  /// Goes on (`Opening::kContinue`) from the counts that the session has, unless they are damaged.
  explicit GpsPart(const std::string& session,
                   exporter::Opening opening = exporter::Opening::kFresh);
  /// Warnings about what was damaged, once.
  Events take_events();
  void on_odometry(const Odometry& odometry);
  void on_status(const GpsStatus& status);
  void on_datum(const Datum& datum);
  /// Cheap enough for once a second, so that a program that is killed leaves what it counted.
  void keep_counts(const GpsStatus& status);

 private:
  std::string session_;
  Events events_;
  exporter::TrajectoryWriter trajectory_;
  exporter::GpsStatusLog statuses_;
  exporter::CountsWriter counts_;
};

/// The datum that is stored in a session folder, if any. Throws std::runtime_error when the file is
/// damaged.
std::optional<Datum> read_stored_datum(const std::string& session);

/// For a program on the bus, which must start all the same: a damaged file (a power failure leaves
/// empty ones) counts for none, and `events` gets a warning.
std::optional<Datum> stored_datum(const std::string& session, Events& events);

/// The checkpoint that a mapper left in a session folder, if any.
std::optional<lio_mapper::Checkpoint> stored_checkpoint(const std::string& session);

/// What one needs of a session to go on from it.
struct StoredSession {
  lio_mapper::Checkpoint checkpoint;
  lio_mapper::StoredPoints points;
  std::optional<Pose> first_pose;  ///< of the checkpoint's odom epoch
};

/// Throws ConfigError that says what the folder lacks, and what KeyframeReader throws.
StoredSession open_stored_session(const std::string& session);

/// What a mapper's part does with what is there.
enum class Continuing {
  kNo,      ///< begins
  kYes,     ///< the files go on
  kNoStore  ///< begins, without a keyframe store unless a keyframe is made
};

/// lio.tum, scans.csv, keyframes.sqlite and the mapper's counts.
class MapperPart {
 public:
  explicit MapperPart(const std::string& session, Continuing continuing = Continuing::kNo);
  void on_scan(const lio_mapper::ScanResult& scan);
  /// With what the mapper knows after its last scan.
  void close(const LioStatus& status,
             const std::optional<lio_mapper::Checkpoint>& checkpoint,
             const std::vector<lio_mapper::StoredRow>& rows);

 private:
  exporter::TrajectoryWriter trajectory_;
  exporter::ScanLog scans_;
  std::string store_;
  std::optional<lio_mapper::KeyframeWriter> keyframes_;
  exporter::CountsWriter counts_;
};

/// fused.tum, gate.csv, alignment.yaml and the gate's counts.
class GatePart {
 public:
  /// Goes on (`Opening::kContinue`) from the alignment and the counts that the session has. Files
  /// of them that are damaged (a power failure leaves empty ones) count for nothing.
  explicit GatePart(const std::string& session,
                    exporter::Opening opening = exporter::Opening::kFresh);
  /// Warnings about what was damaged, once.
  Events take_events();
  void on_fused(const Odometry& odometry);
  void on_status(const FusionStatus& status);
  /// The best alignment at this moment, and whether the mapper has taken it. Without one, or with
  /// one of which nobody knows how good it is (a mapper that looks for its place in the map), the
  /// last one is kept and is not admitted any more. Written when it tells something new, and then
  /// at most every few seconds of data time (the newest status's) unless the gate's verdict on it
  /// changed; cheap enough for every status.
  void on_alignment(const std::optional<Alignment>& best, bool admitted);
  /// Cheap enough for once a second, so that a program that is killed leaves what it counted.
  void keep_counts();
  void close();

 private:
  void write_alignment(const exporter::AlignmentRecord& record);

  std::string session_;
  Events events_;
  exporter::TrajectoryWriter trajectory_;
  exporter::GateLog gate_log_;
  exporter::CountsWriter counts_;
  FusionStatus last_;
  std::optional<exporter::AlignmentRecord> newest_alignment_;
  std::optional<exporter::AlignmentRecord> written_alignment_;
  Nanoseconds written_ns_{0};
};

/// fixes.csv, sweeps.csv, truth.tum and the counts of what the log held and of what was handed on.
class LogPart {
 public:
  explicit LogPart(const std::string& session,
                   exporter::Opening opening = exporter::Opening::kFresh);
  /// Warnings about what was damaged or left out, once.
  Events take_events();
  /// sweeps.csv gets the sweeps before the first IMU sample when that has come.
  void on_entry(const recording::LogEntry& entry);
  /// `log` is what the entries came from; it knows what it passed over. Sweeps of a log without IMU
  /// are on the clock of the receiver: a session that goes on leaves them out, with a warning.
  void close(const recording::LogReader& log);
  /// Copies the truth that lies beside the log, if any; for scoring only. A session that goes on
  /// keeps the truth that it has, and what is later is appended: unless the two are in `map` at
  /// different datums, since then the new one is in another frame. A truth that cannot be read is
  /// no reason to stop: nothing of it is appended, and a warning says why.
  void keep_truth(const recording::LogReader& log);

  /// From the first to the newest entry.
  double data_s() const;

  /// Stamps of the first and the newest IMU sample, if any.
  std::optional<Nanoseconds> begin_ns() const { return begin_ns_; }

  std::optional<Nanoseconds> end_ns() const {
    return newest_imu_ ? std::optional(newest_imu_->stamp_ns) : std::nullopt;
  }

  std::uint64_t sweeps() const { return sweeps_; }

 private:
  struct Moment {
    Nanoseconds stamp_ns{0};
    Nanoseconds receive_ns{0};
  };

  void on_imu(Moment sample);
  void on_sweep(Moment sweep);
  void write(Moment sweep, Moment imu);
  void write_without_imu();

  std::string session_;
  Events events_;
  exporter::Opening opening_;
  exporter::FixLog fixes_;
  exporter::SweepLog sweep_log_;
  exporter::CountsWriter counts_;
  std::optional<Nanoseconds> first_ns_;
  std::optional<Nanoseconds> last_ns_;
  std::optional<Nanoseconds> begin_ns_;
  std::optional<Moment> newest_imu_;
  std::vector<Moment> early_sweeps_;  ///< before the first IMU sample: when they came shows then
  std::uint64_t sweeps_{0};
  std::uint64_t imu_{0};
  std::uint64_t twists_{0};
  std::uint64_t yaws_{0};
  std::uint64_t fixes_fed_{0};
  std::uint64_t fixes_withheld_{0};
};

}  // namespace trigpoint::pipeline
