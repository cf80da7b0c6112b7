// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One interface for every recorded (or simulated) drive.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/robot.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint::recording {

/// A log that cannot be read; names the file, what was found and what was expected.
class LogError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

using Measurement =
    std::variant<ImuSample, GnssFix, PointCloudMessage, TwistMeasurement, YawMeasurement>;

/// One input in the order in which it became available.
struct LogEntry {
  Nanoseconds receive_ns{0};  ///< recorded arrival; a sweep arrives with its last point
  Measurement measurement;
  bool withheld{false};  ///< a fix for scoring only, not to be fed to any filter
};

struct TopicSummary {
  std::string topic;
  std::string type;  ///< e.g. "sensor_msgs/msg/Imu"
  std::uint64_t messages{0};
};

struct LogSummary {
  std::string path;
  std::string format;  ///< "rosbag1", "rosbag2", "mcap", "kitti", "scenario"
  Nanoseconds first_ns{0};
  Nanoseconds last_ns{0};
  std::vector<TopicSummary> topics;
  /// What is wrong with the log as a whole, in sentences: cut off, damaged, its recorder was
  /// killed, a file of it is missing. Empty when nothing is known to be wrong.
  std::vector<std::string> faults;
};

/// Messages that were passed over because they are not what their topic promises.
struct Undecodable {
  std::string input;   ///< "points", "imu", "fix", "twist" or "yaw"
  std::string topic;   ///< as the log spells it
  std::string reason;  ///< e.g. "not a sensor_msgs/msg/Imu"
  std::uint64_t count{0};
};

class LogReader {
 public:
  virtual ~LogReader() = default;

  virtual const LogSummary& summary() const = 0;
  /// The next entry of the mapped topics in order of receive_ns; nullopt at the end. Throws
  /// LogError when the log breaks off; what came before stays valid.
  virtual std::optional<LogEntry> next() = 0;
  /// 0 to 1, for progress bars.
  virtual double progress() const = 0;

  /// What next() has passed over so far, by topic and reason.
  virtual std::vector<Undecodable> undecodable() const { return {}; }

  /// What there is to tell since the last call: the first message of a topic that was passed over.
  virtual Events take_events() { return {}; }

  /// A trajectory file (TUM) with the truth beside the log, if there is one.
  virtual std::optional<std::string> truth_file() const { return std::nullopt; }

  /// What the log itself knows of the robot (KITTI's calibration, a scenario's sensors); what the
  /// user's configuration leaves at its default is taken from here.
  virtual std::optional<RobotConfig> robot() const { return std::nullopt; }
};

/// The log's faults as warnings, for before the first entry.
Events fault_events(const LogSummary& summary);

/// How many messages were passed over, an event for each topic and reason, for after the last
/// entry.
Events undecodable_events(const LogReader& log);

/// What is asked of a log.
struct LogOptions {
  bool require_points{true};  ///< without this topic the log is refused
  bool require_imu{true};
  bool require_fix{true};
  bool require_aiding{true};      ///< where the robot has a topic for twists or yaws
  double fix_rate_limit_hz{0.0};  ///< fixes beyond this rate are delivered as withheld; 0 = all fed
  double start_s{0.0};            ///< skip this much, s after the log's first entry
  double duration_s{0.0};         ///< then deliver this much; 0 = to the end
  /// KITTI only: IMU and fixes are delivered from this long before the first sweep, s.
  double lead_in_s{3.0};
  /// KITTI only: every beam is turned upwards by this angle, rad (README, "Elevation angles").
  double elevation_correction_rad{0.0};
};

/// Opens a ROS 1 bag or an MCAP file (known by their first bytes), a rosbag2 folder or .db3 file,
/// or a KITTI raw drive folder. Throws LogError when the path does not exist, is empty, is of no
/// known kind, or lacks a mapped topic (naming it, what is there instead, and the nearest name).
std::unique_ptr<LogReader> open_log(const std::string& path, const RobotConfig& robot);
std::unique_ptr<LogReader> open_log(const std::string& path,
                                    const RobotConfig& robot,
                                    const LogOptions& options);

}  // namespace trigpoint::recording
