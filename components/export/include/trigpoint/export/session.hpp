// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The session folder: what every program writes and what the report reads. Each line is handed to
// the operating system as it is made, so a killed program leaves valid files. Every function and
// writer throws std::runtime_error naming the file and the cause (a full disk too); a writer stays
// usable afterwards: a line that did not fit whole is taken back.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::exporter {

/// Names of the files in a session folder; formats are in the README.
namespace session_file {
inline constexpr const char* kConfig = "config.yaml";
inline constexpr const char* kDatum = "datum.yaml";
inline constexpr const char* kRun = "run.yaml";
inline constexpr const char* kAlignment = "alignment.yaml";
inline constexpr const char* kFused = "fused.tum";
inline constexpr const char* kFusedSmoothed = "fused_smoothed.tum";
inline constexpr const char* kLio = "lio.tum";
inline constexpr const char* kGps = "gps.tum";
inline constexpr const char* kTruth = "truth.tum";
inline constexpr const char* kFixes = "fixes.csv";
inline constexpr const char* kGate = "gate.csv";
inline constexpr const char* kGpsStatus = "gps_status.csv";
inline constexpr const char* kScans = "scans.csv";
inline constexpr const char* kSweeps = "sweeps.csv";
inline constexpr const char* kKeyframes = "keyframes.sqlite";
inline constexpr const char* kKeyframePoses = "keyframes.tum";  ///< corrected
inline constexpr const char* kMap = "map.pcd";
inline constexpr const char* kReport = "report.md";
inline constexpr const char* kPlots = "plots";
inline constexpr const char* kCountsSuffix = ".counts.yaml";  ///< after the program's name
}  // namespace session_file

/// `folder`/`name`.
std::string path_in(const std::string& folder, const std::string& name);

/// Creates the folder and its parents; an existing one is fine.
void create_session_folder(const std::string& folder);

/// Replaces `file` whole or not at all (written beside it, then renamed).
void write_text(const std::string& file, const std::string& text);

/// Copies e.g. a truth trajectory into the session.
void copy_file(const std::string& from, const std::string& to);

/// What a writer does with a file that exists: begin anew, or go on after its last whole line (a
/// program that was restarted within one session).
enum class Opening { kFresh, kContinue };

class LineFile;

/// TUM: `t x y z qx qy qz qw`, t in seconds with exactly nine decimals printed from the integer.
class TrajectoryWriter {
 public:
  /// `frame_comment` says frame and content, e.g. "base_link in map, online".
  TrajectoryWriter(const std::string& file,
                   const std::string& frame_comment,
                   Opening opening = Opening::kFresh);
  ~TrajectoryWriter();
  /// False, and nothing written, when the pose is not finite or the stamp is not later than the one
  /// before: a trajectory is one pose a moment, in order.
  bool append(Nanoseconds stamp_ns, const Pose& T_frame_base);

 private:
  std::unique_ptr<LineFile> lines_;
  Nanoseconds last_stamp_ns_;
};

struct StampedPose {
  Nanoseconds stamp_ns{0};
  Pose pose;
};

using Trajectory = std::vector<StampedPose>;

/// Strict: throws with file:line for a wrong number of columns, what is not a number, not finite, a
/// quaternion that is not of unit length, or a stamp that is not later than the one before. A last
/// line without its end (a writer died in it) is left out. Stamps are read to the nanosecond.
Trajectory read_trajectory(const std::string& file);

/// "1317377394.123456789" from and to integer nanoseconds, without loss.
std::string stamp_text(Nanoseconds stamp_ns);

/// fixes.csv: every fix of the log, withheld ones too. A variance that is not known is `nan`.
class FixLog {
 public:
  explicit FixLog(const std::string& file, Opening opening = Opening::kFresh);
  ~FixLog();
  void append(const GnssFix& fix, Nanoseconds receive_ns, bool withheld);

 private:
  std::unique_ptr<LineFile> lines_;
};

struct LoggedFix {
  GnssFix fix;  ///< covariance: diagonal only
  Nanoseconds receive_ns{0};
  bool withheld{false};
};

std::vector<LoggedFix> read_fixes(const std::string& file);

/// A sweep of the log, as it was handed on: to the cores, or published.
struct LoggedSweep {
  Nanoseconds stamp_ns{0};    ///< of its message
  Nanoseconds receive_ns{0};  ///< when the log had it
  /// The same moment on the clock of the IMU's stamps, which the estimates have too: the LiDAR's
  /// own may be another one, or be set while it drives.
  Nanoseconds arrival_ns{0};
};

/// sweeps.csv: every sweep of the log, answered or not.
class SweepLog {
 public:
  explicit SweepLog(const std::string& file, Opening opening = Opening::kFresh);
  ~SweepLog();
  void append(const LoggedSweep& sweep);

 private:
  std::unique_ptr<LineFile> lines_;
};

std::vector<LoggedSweep> read_sweeps(const std::string& file);

/// gate.csv: a row per FusionStatus, and before it one for each further verdict that it tells.
class GateLog {
 public:
  explicit GateLog(const std::string& file, Opening opening = Opening::kFresh);
  ~GateLog();
  void append(const FusionStatus& status);

 private:
  std::unique_ptr<LineFile> lines_;
};

std::vector<FusionStatus> read_gate_log(const std::string& file);

/// gps_status.csv: one row per GpsStatus.
class GpsStatusLog {
 public:
  explicit GpsStatusLog(const std::string& file, Opening opening = Opening::kFresh);
  ~GpsStatusLog();
  void append(const GpsStatus& status);

 private:
  std::unique_ptr<LineFile> lines_;
};

std::vector<GpsStatus> read_gps_status(const std::string& file);

/// scans.csv: one row per processed sweep.
class ScanLog {
 public:
  explicit ScanLog(const std::string& file, Opening opening = Opening::kFresh);
  ~ScanLog();
  /// `points`: those that went into the filter. scan_ms must be filled in `status`.
  void append(const LioStatus& status, std::uint64_t points);

 private:
  std::unique_ptr<LineFile> lines_;
};

struct LoggedScan {
  LioStatus status;  ///< the fields that scans.csv holds
  std::uint64_t points{0};
};

std::vector<LoggedScan> read_scans(const std::string& file);

void write_datum(const std::string& file, const Datum& datum);
Datum read_datum(const std::string& file);

/// The best alignment known so far, also when the gate has not admitted it.
struct AlignmentRecord {
  Alignment alignment;
  bool admitted{false};
  std::string comment;       ///< e.g. why it is not admitted
  bool was_admitted{false};  ///< it or one before it (of another odom epoch, say), but not now
};

/// False when the covariance is the placeholder of what nobody knows (kUnknownVariance).
bool is_known(const Alignment& alignment);

/// Whether `next` tells a reader something that `written` does not: another epoch or verdict, or a
/// map that lies visibly elsewhere.
bool differs_substantially(const AlignmentRecord& next, const AlignmentRecord& written);

void write_alignment(const std::string& file, const AlignmentRecord& record);
AlignmentRecord read_alignment(const std::string& file);

/// The datum that a trajectory file names in its head ("# datum LAT LON HEIGHT", deg, deg, m), as
/// truth files do; nullopt when it names none.
std::optional<Datum> datum_named_in(const std::string& trajectory_file);

/// What was run, for the report.
struct RunInfo {
  std::string log;          ///< path or scenario
  std::string how;          ///< "dds" or "offline"
  std::string mode;         ///< of the gate
  std::string gps_filter;   ///< e.g. "ekf15"
  double data_s{0.0};       ///< duration of the log
  double wall_s{0.0};       ///< processing time; both are 0 until the run has ended
  bool interrupted{false};  ///< by the user: what was in flight then is missing
  /// Stamps of the first and the last IMU sample of the log, as used; nullopt: none, or not known.
  std::optional<Nanoseconds> begin_ns{};
  std::optional<Nanoseconds> end_ns{};
  /// What the session held already when it was resumed, oldest first; they have none themselves.
  std::vector<RunInfo> before{};
};

void write_run(const std::string& file, const RunInfo& run);
RunInfo read_run(const std::string& file);

/// What a session that goes on has been so far, oldest first: its run.yaml and what that has as
/// `before`. A session without run.yaml was run by programs that write none; empty for an empty
/// folder.
std::vector<RunInfo> runs_in(const std::string& session);

/// <program>.counts.yaml: `name: number` lines, replaced whole at each write. Names are
/// `<stream>.<what>[.<reason>]`, stream one of points, imu, fix; what one of in_log, published,
/// withheld, received, used, refused, note (used all the same), and of the gate judged, verdict
/// (kinds of use among them).
/// The report compares them along the way of each stream.
class CountsWriter {
 public:
  /// `Opening::kContinue`: what the session's file says already is added to what is written. Throws
  /// std::runtime_error when that file is damaged.
  CountsWriter(const std::string& folder,
               const std::string& program,
               Opening opening = Opening::kFresh);
  void write(const std::vector<NamedCount>& counts) const;

 private:
  std::string file_;
  std::vector<NamedCount> before_;
};

std::vector<NamedCount> read_counts(const std::string& file);  ///< throws when damaged or empty

/// The counts of each program under the names that the report knows.
std::vector<NamedCount> counts_of(const GpsStatus& status);
std::vector<NamedCount> counts_of(const LioStatus& status);
std::vector<NamedCount> counts_of(const FusionStatus& status);

}  // namespace trigpoint::exporter
