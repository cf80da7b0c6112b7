// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bag_source.hpp"

#include "skipped_messages.hpp"

#include <algorithm>
#include <filesystem>
#include <map>

namespace trigpoint::recording {

namespace {

class BagReader : public LogReader {
 public:
  BagReader(std::unique_ptr<BagSource> source, TopicChoice topics)
      : source_(std::move(source)), topics_(std::move(topics)) {
    source_->select({topics_.points, topics_.imu, topics_.fix});
  }

  const LogSummary& summary() const override { return source_->summary(); }

  std::optional<LogEntry> next() override {
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
    if (folder.extension() == ".db3") {
      beside = beside.parent_path();
    }
    const auto file = beside / "truth.tum";
    return std::filesystem::is_regular_file(file) ? std::optional(file.string()) : std::nullopt;
  }

 private:
  std::optional<LogEntry> entry_of(const RawMessage& raw) {
    if (raw.topic == topics_.points) {
      return decoded<PointCloudMessage>(raw, "points", "sensor_msgs/msg/PointCloud2");
    }
    if (raw.topic == topics_.imu) {
      return decoded<ImuSample>(raw, "imu", "sensor_msgs/msg/Imu");
    }
    return decoded<GnssFix>(raw, "fix", "sensor_msgs/msg/NavSatFix");
  }

  /// nullopt for a message that is damaged; it is counted, and the log goes on.
  template <class Message>
  std::optional<LogEntry> decoded(const RawMessage& raw, const char* input, const char* type) {
    const std::uint64_t number = ++numbers_[raw.topic];
    Message message;
    if (source_->decode(raw, message)) {
      return LogEntry{raw.receive_ns, std::move(message)};
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
  SkippedMessages skipped_;
  std::map<std::string, std::uint64_t> numbers_;  ///< messages so far, by topic
  Nanoseconds now_ns_{0};
};

}  // namespace

std::unique_ptr<LogReader> read_bag(std::unique_ptr<BagSource> source,
                                    const RobotConfig& robot,
                                    const LogOptions& options) {
  TopicChoice topics = choose_topics(source->summary(), robot, options);
  return std::make_unique<BagReader>(std::move(source), std::move(topics));
}

}  // namespace trigpoint::recording
