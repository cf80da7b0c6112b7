// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bag_source.hpp"

#include "skipped_messages.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

namespace trigpoint::recording {

namespace {

/// Messages are put in order and played by their times of receiving; throws LogError when the log
/// has none.
void require_receive_times(const LogSummary& log) {
  std::uint64_t messages = 0;
  for (const TopicSummary& topic : log.topics) {
    messages += topic.messages;
  }
  if (messages > 1 && log.first_ns == log.last_ns) {
    throw LogError(log.path + ": all " + std::to_string(messages) +
                   " messages are stored as received at " +
                   std::to_string(to_seconds(log.first_ns)) +
                   " s: what wrote the log did not set the times of receiving, by which messages "
                   "are put in order. Write it anew with them (log_time in MCAP, timestamp in "
                   "rosbag2's database); the stamp of a message's header will do");
  }
}

/// With what is wrong with the times of receiving of some messages.
LogSummary judged(LogSummary log) {
  if (log.first_ns == 0 && log.last_ns > 0) {
    log.faults.push_back(log.path +
                         ": messages are stored as received at 0 s, others later: the log seems to "
                         "last " +
                         std::to_string(to_seconds(log.last_ns)) +
                         " s, and log.start_s and log.duration_s count from 0 s");
  }
  return log;
}

class BagReader : public LogReader {
 public:
  BagReader(std::unique_ptr<BagSource> source, TopicChoice topics)
      : source_(std::move(source)),
        topics_(std::move(topics)),
        summary_(judged(source_->summary())) {
    source_->select({topics_.points, topics_.imu, topics_.fix, topics_.twist, topics_.yaw});
  }

  const LogSummary& summary() const override { return summary_; }

  std::optional<LogEntry> next() override {
    if (second_) {
      return std::exchange(second_, std::nullopt);
    }
    while (const auto raw = source_->next()) {
      now_ns_ = raw->receive_ns;
      if (auto entry = entry_of(*raw)) {
        return entry;
      }
    }
    now_ns_ = summary().last_ns;
    return std::nullopt;
  }

  double progress() const override {
    const double span_s = to_seconds(summary().last_ns - summary().first_ns);
    return span_s > 0.0 ? std::clamp(to_seconds(now_ns_ - summary().first_ns) / span_s, 0.0, 1.0)
                        : 0.0;
  }

  std::vector<Undecodable> undecodable() const override { return skipped_.counts(); }

  Events take_events() override { return skipped_.take_events(); }

  /// `trigpoint simulate --out DIR` writes DIR/log and DIR/truth.tum.
  std::optional<std::string> truth_file() const override {
    const auto folder = std::filesystem::absolute(summary().path).lexically_normal();
    auto beside = folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path();
    if (folder.extension() == ".db3" || folder.extension() == ".mcap") {
      beside = beside.parent_path();
    }
    const auto file = beside / "truth.tum";
    return std::filesystem::is_regular_file(file) ? std::optional(file.string()) : std::nullopt;
  }

 private:
  std::optional<LogEntry> entry_of(const RawMessage& raw) {
    if (raw.topic == topics_.points) {
      return entry<PointCloudMessage>(raw, "points", "sensor_msgs/msg/PointCloud2");
    }
    if (raw.topic == topics_.imu) {
      if (raw.topic == topics_.yaw) {
        second_ = yaw_of(raw);
      }
      return entry<ImuSample>(raw, "imu", "sensor_msgs/msg/Imu");
    }
    if (raw.topic == topics_.twist) {
      return topics_.twist_is_odometry
                 ? twist_of(raw, decoded<Odometry>(raw, "twist", "nav_msgs/msg/Odometry"))
                 : entry<TwistMeasurement>(
                       raw, "twist", "geometry_msgs/msg/TwistWithCovarianceStamped");
    }
    if (raw.topic == topics_.yaw) {
      return entry<YawMeasurement>(raw, "yaw", "sensor_msgs/msg/Imu");
    }
    return entry<GnssFix>(raw, "fix", "sensor_msgs/msg/NavSatFix");
  }

  /// Of an IMU that is also the heading; a damaged message is counted as the IMU's.
  std::optional<LogEntry> yaw_of(const RawMessage& raw) const {
    YawMeasurement yaw;
    return source_->decode(raw, yaw) ? std::optional(LogEntry{raw.receive_ns, std::move(yaw)})
                                     : std::nullopt;
  }

  /// What a twist topic of this type means.
  static std::optional<LogEntry> twist_of(const RawMessage& raw,
                                          const std::optional<Odometry>& odometry) {
    if (!odometry) {
      return std::nullopt;
    }
    TwistMeasurement twist;
    twist.stamp_ns = odometry->stamp_ns;
    twist.frame_id = odometry->child_frame_id;
    twist.linear_mps = odometry->linear_mps;
    twist.covariance_m2ps2 = odometry->twist_covariance.topLeftCorner<3, 3>();
    return LogEntry{raw.receive_ns, std::move(twist)};
  }

  template <class Message>
  std::optional<LogEntry> entry(const RawMessage& raw, const char* input, const char* type) {
    auto message = decoded<Message>(raw, input, type);
    return message ? std::optional(LogEntry{raw.receive_ns, std::move(*message)}) : std::nullopt;
  }

  /// nullopt for a message that is damaged; it is counted, and the log goes on.
  template <class Message>
  std::optional<Message> decoded(const RawMessage& raw, const char* input, const char* type) {
    const std::uint64_t number = ++numbers_[raw.topic];
    Message message;
    if (source_->decode(raw, message)) {
      return message;
    }
    skipped_.add({input, raw.topic, std::string("not a ") + type},
                 number,
                 raw.receive_ns,
                 "its " + std::to_string(raw.bytes.size()) + " bytes, received at " +
                     std::to_string(to_seconds(raw.receive_ns)) + " s, are not a " + type);
    return std::nullopt;
  }

  std::unique_ptr<BagSource> source_;
  TopicChoice topics_;
  LogSummary summary_;
  SkippedMessages skipped_;
  std::optional<LogEntry> second_;                ///< of the same message
  std::map<std::string, std::uint64_t> numbers_;  ///< messages so far, by topic
  Nanoseconds now_ns_{0};
};

}  // namespace

std::unique_ptr<LogReader> read_bag(std::unique_ptr<BagSource> source,
                                    const RobotConfig& robot,
                                    const LogOptions& options) {
  TopicChoice topics = choose_topics(source->summary(), robot, options);
  require_receive_times(source->summary());
  return std::make_unique<BagReader>(std::move(source), std::move(topics));
}

}  // namespace trigpoint::recording
