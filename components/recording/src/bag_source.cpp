// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bag_source.hpp"

#include <algorithm>
#include <filesystem>

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
    const auto raw = source_->next();
    if (!raw) {
      now_ns_ = summary().last_ns;
      return std::nullopt;
    }
    now_ns_ = raw->receive_ns;
    LogEntry entry;
    entry.receive_ns = raw->receive_ns;
    if (raw->topic == topics_.points) {
      entry.measurement = decoded<PointCloudMessage>(*raw);
    } else if (raw->topic == topics_.imu) {
      entry.measurement = decoded<ImuSample>(*raw);
    } else {
      entry.measurement = decoded<GnssFix>(*raw);
    }
    return entry;
  }

  double progress() const override {
    const double span_s = to_seconds(summary().last_ns - summary().first_ns);
    return span_s > 0.0 ? std::clamp(to_seconds(now_ns_ - summary().first_ns) / span_s, 0.0, 1.0)
                        : 0.0;
  }

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
  template <class Message>
  Message decoded(const RawMessage& raw) const {
    Message message;
    if (!source_->decode(raw, message)) {
      throw LogError(summary().path + ": a message of " + std::to_string(raw.bytes.size()) +
                     " bytes on '" + raw.topic + "' received at " +
                     std::to_string(to_seconds(raw.receive_ns)) + " s is damaged");
    }
    return message;
  }

  std::unique_ptr<BagSource> source_;
  TopicChoice topics_;
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
