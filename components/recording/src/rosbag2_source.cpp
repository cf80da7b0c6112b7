// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rosbag2_source.hpp"

#include "trigpoint/bus/cdr.hpp"

#include "rosbag2_metadata.hpp"
#include "sqlite.hpp"
#include "sqlite_salvage.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

/// "drive_10.db3" after "drive_9.db3".
bool before(const fs::path& a, const fs::path& b) {
  const auto name_a = a.filename().string();
  const auto name_b = b.filename().string();
  return name_a.size() != name_b.size() ? name_a.size() < name_b.size() : name_a < name_b;
}

std::vector<fs::path> listed(const fs::path& folder, const Rosbag2Metadata& metadata) {
  if (metadata.storage != "sqlite3" || !metadata.compression_format.empty()) {
    throw LogError(folder.string() + ": a rosbag2 of storage '" + metadata.storage + "'" +
                   (metadata.compression_format.empty()
                        ? ""
                        : " compressed with " + metadata.compression_format) +
                   "; only uncompressed sqlite3 is read here. `ros2 bag convert` makes one");
  }
  std::vector<fs::path> files;
  for (const auto& name : metadata.files) {
    // Old versions wrote the folder's name in front.
    const auto file =
        fs::exists(folder / name) ? folder / name : folder / fs::path(name).filename();
    if (!fs::exists(file)) {
      throw LogError(file.string() + ": does not exist, but metadata.yaml names it");
    }
    files.push_back(file);
  }
  return files;
}

/// Opens for reading: a WAL left by a killed recorder needs a shared-memory file beside it, which a
/// read-only disk refuses; then without the WAL. `repair` makes SQLite read files that are cut off.
Database open_database(const std::string& file, bool repair) {
  Database database(file, SQLITE_OPEN_READONLY);
  try {
    database.run("PRAGMA writable_schema=" + std::string(repair ? "ON" : "OFF"));
    database.prepare("SELECT count(*) FROM sqlite_master").step();
    return database;
  } catch (const LogError&) {
    Database alone("file:" + file + "?immutable=1", SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
    alone.run("PRAGMA writable_schema=" + std::string(repair ? "ON" : "OFF"));
    return alone;
  }
}

/// One .db3; messages in order of time. Where SQLite can't go on in a damaged file, its leaves are
/// looked for one by one, and at the end the damage is an error.
class Db3 {
 public:
  explicit Db3(const fs::path& file) : file_(file.string()) {
    if (fs::file_size(file) == 0) {
      throw LogError(file.string() + ": the file is empty");
    }
    try {
      read_topics(false);
      count();
    } catch (const LogError& error) {
      damage_ = error.what();
      salvage_topics();
      begin_salvage();
      count_salvaged();
    }
  }

  const std::map<std::int64_t, TopicSummary>& topics() const { return topics_; }

  Nanoseconds first_ns() const { return first_ns_; }

  Nanoseconds last_ns() const { return last_ns_; }

  /// Empty when nothing is known to be wrong.
  std::string fault() const {
    if (!damage_.empty()) {
      return damage_ + "; the file is cut off or damaged, " + std::to_string(counted()) +
             " messages can be read";
    }
    std::error_code none;
    const auto log_bytes = fs::file_size(file_ + "-wal", none);
    return none || log_bytes == 0
               ? ""
               : file_ + ": has a write-ahead log of " + std::to_string(log_bytes) +
                     " bytes beside it: its recorder was killed or still writes";
  }

  void select(const std::set<std::string>& names) {
    std::string ids = "-1";
    for (const auto& [id, topic] : topics_) {
      if (names.count(topic.topic) > 0) {
        ids += "," + std::to_string(id);
        selected_.insert(id);
      }
    }
    if (!salvage_) {
      messages_.emplace(database_->prepare(
          "SELECT timestamp, topic_id, data, id FROM messages WHERE topic_id IN (" + ids +
          ") ORDER BY timestamp, id"));
    }
  }

  std::optional<RawMessage> next() {
    if (!salvage_) {
      try {
        return next_row();
      } catch (const LogError& error) {
        damage_ = error.what();
        begin_salvage();
      }
    }
    if (auto raw = next_salvaged()) {
      return raw;
    }
    throw LogError(damage_ + "; the log breaks off, the file is cut off or damaged; the " +
                   std::to_string(salvage_->rows().size()) +
                   " messages that are whole in it were read");
  }

 private:
  void read_topics(bool repair) {
    topics_.clear();
    database_.emplace(open_database(file_, repair));
    auto rows = database_->prepare("SELECT id, name, type, serialization_format FROM topics");
    while (rows.step()) {
      if (rows.text(3) != "cdr") {
        throw LogError(file_ + ": topic '" + rows.text(1) + "' is serialised as '" + rows.text(3) +
                       "', expected cdr");
      }
      topics_[rows.integer(0)] = {rows.text(1), ros2_type_name(rows.text(2)), 0};
    }
  }

  void salvage_topics() {
    try {
      read_topics(true);
    } catch (const LogError&) {
      throw LogError(damage_ +
                     "; the file is damaged at its beginning or no rosbag2: not even its topics "
                     "can be read");
    }
  }

  /// Walks over the messages without their data.
  void count() {
    auto rows =
        database_->prepare("SELECT topic_id, timestamp FROM messages NOT INDEXED ORDER BY id");
    while (rows.step()) {
      count(rows.integer(0), rows.integer(1));
    }
  }

  void count(std::int64_t topic_id, Nanoseconds time_ns) {
    const auto topic = topics_.find(topic_id);
    if (topic == topics_.end()) {
      return;
    }
    first_ns_ = first_ns_ == 0 ? time_ns : std::min(first_ns_, time_ns);
    last_ns_ = std::max(last_ns_, time_ns);
    ++topic->second.messages;
  }

  void count_salvaged() {
    first_ns_ = last_ns_ = 0;
    for (const SalvagedRow& row : salvage_->rows()) {
      count(row.topic_id, row.timestamp_ns);
    }
  }

  std::uint64_t counted() const {
    std::uint64_t sum = 0;
    for (const auto& [id, topic] : topics_) {
      sum += topic.messages;
    }
    return sum;
  }

  std::optional<RawMessage> next_row() {
    if (!messages_->step()) {
      return std::nullopt;
    }
    at_ = {messages_->integer(0), messages_->integer(3)};
    const auto blob = messages_->blob(2);
    return RawMessage{
        at_.first, topics_.at(messages_->integer(1)).topic, {blob.begin(), blob.end()}};
  }

  void begin_salvage() { salvage_ = std::make_unique<SqliteSalvage>(file_); }

  std::optional<RawMessage> next_salvaged() {
    while (next_salvaged_ < salvage_->rows().size()) {
      const SalvagedRow& row = salvage_->rows()[next_salvaged_++];
      if (selected_.count(row.topic_id) == 0 || std::pair(row.timestamp_ns, row.id) <= at_) {
        continue;
      }
      if (auto bytes = salvage_->data(row)) {
        return RawMessage{row.timestamp_ns, topics_.at(row.topic_id).topic, std::move(*bytes)};
      }
    }
    return std::nullopt;
  }

  std::string file_;
  std::string damage_;  ///< SQLite's own words
  std::optional<Database> database_;
  std::optional<Statement> messages_;
  std::map<std::int64_t, TopicSummary> topics_;
  std::set<std::int64_t> selected_;
  std::pair<std::int64_t, std::int64_t> at_{0, 0};  ///< time and id of the newest row from SQLite
  std::unique_ptr<SqliteSalvage> salvage_;          ///< in its place from where it failed
  std::size_t next_salvaged_{0};
  Nanoseconds first_ns_{0};
  Nanoseconds last_ns_{0};
};

class Rosbag2Source : public BagSource {
 public:
  Rosbag2Source(const fs::path& path, const std::vector<fs::path>& files) {
    for (const auto& file : files) {
      files_.push_back(std::make_unique<Db3>(file));
    }
    summarize(path);
  }

  const LogSummary& summary() const override { return summary_; }

  void select(const std::vector<std::string>& topics) override {
    for (auto& file : files_) {
      file->select({topics.begin(), topics.end()});
    }
  }

  std::optional<RawMessage> next() override {
    for (; at_ < files_.size(); ++at_) {
      try {
        if (auto raw = files_[at_]->next()) {
          return raw;
        }
      } catch (const LogError& error) {
        // The bag's other files may be whole.
        damage_ += (damage_.empty() ? "" : "\n") + std::string(error.what());
      }
    }
    if (!damage_.empty()) {
      throw LogError(damage_);
    }
    return std::nullopt;
  }

  bool decode(const RawMessage& raw, ImuSample& imu) const override {
    return bus::decode_cdr(raw.bytes, imu);
  }

  bool decode(const RawMessage& raw, GnssFix& fix) const override {
    return bus::decode_cdr(raw.bytes, fix);
  }

  bool decode(const RawMessage& raw, PointCloudMessage& cloud) const override {
    return bus::decode_cdr(raw.bytes, cloud);
  }

  bool decode(const RawMessage& raw, TwistMeasurement& twist) const override {
    return bus::decode_cdr(raw.bytes, twist);
  }

  bool decode(const RawMessage& raw, Odometry& odometry) const override {
    return bus::decode_cdr(raw.bytes, odometry);
  }

  bool decode(const RawMessage& raw, YawMeasurement& yaw) const override {
    return bus::decode_cdr(raw.bytes, yaw);
  }

 private:
  void summarize(const fs::path& path) {
    summary_.path = path.string();
    summary_.format = "rosbag2";
    std::map<std::string, TopicSummary> topics;
    for (const auto& file : files_) {
      for (const auto& [id, topic] : file->topics()) {
        auto& sum = topics[topic.topic];
        sum = {topic.topic, topic.type, sum.messages + topic.messages};
      }
      if (file->first_ns() != 0) {
        summary_.first_ns = summary_.first_ns == 0 ? file->first_ns()
                                                   : std::min(summary_.first_ns, file->first_ns());
        summary_.last_ns = std::max(summary_.last_ns, file->last_ns());
      }
    }
    for (const auto& [name, topic] : topics) {
      summary_.topics.push_back(topic);
    }
    note_faults(path);
  }

  void note_faults(const fs::path& path) {
    if (fs::is_directory(path) && !fs::is_regular_file(path / "metadata.yaml")) {
      summary_.faults.push_back(path.string() +
                                ": has no metadata.yaml: its recorder was killed or still writes; "
                                "its last second may be missing");
    }
    for (const auto& file : files_) {
      if (auto fault = file->fault(); !fault.empty()) {
        summary_.faults.push_back(std::move(fault));
      }
    }
  }

  // Statements refer to their database: neither may move.
  std::vector<std::unique_ptr<Db3>> files_;
  std::size_t at_{0};
  std::string damage_;
  LogSummary summary_;
};

}  // namespace

std::vector<fs::path> find_rosbag2_files(const fs::path& path) {
  if (fs::is_regular_file(path)) {
    return path.extension() == ".db3" ? std::vector{path} : std::vector<fs::path>{};
  }
  if (fs::is_regular_file(path / "metadata.yaml")) {
    return listed(path, read_metadata(path / "metadata.yaml"));
  }
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) {
    if (entry.path().extension() == ".db3") {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end(), before);
  return files;
}

std::unique_ptr<BagSource> open_rosbag2(const fs::path& path, const std::vector<fs::path>& files) {
  return std::make_unique<Rosbag2Source>(path, files);
}

}  // namespace trigpoint::recording
