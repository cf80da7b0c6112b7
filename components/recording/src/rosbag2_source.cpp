// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rosbag2_source.hpp"

#include "trigpoint/bus/cdr.hpp"

#include "rosbag2_metadata.hpp"
#include "sqlite.hpp"

#include <algorithm>
#include <map>
#include <set>

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

/// One .db3; messages in order of time, or of recording when the file is damaged.
class Db3 {
 public:
  explicit Db3(const fs::path& file) : file_(file.string()) {
    check_header(file);
    try {
      open(false);
    } catch (const LogError&) {
      open(true);
    }
  }

  bool damaged() const { return damaged_; }

  const std::map<std::int64_t, TopicSummary>& topics() const { return topics_; }

  Nanoseconds first_ns() const { return first_ns_; }

  Nanoseconds last_ns() const { return last_ns_; }

  void select(const std::set<std::string>& names) {
    std::string ids = "-1";
    for (const auto& [id, topic] : topics_) {
      ids += names.count(topic.topic) > 0 ? "," + std::to_string(id) : "";
    }
    messages_.emplace(
        database_->prepare("SELECT timestamp, topic_id, data FROM messages WHERE topic_id IN (" +
                           ids + ") ORDER BY " + (damaged_ ? "id" : "timestamp, id")));
  }

  std::optional<RawMessage> next() {
    try {
      if (messages_->step()) {
        const auto blob = messages_->blob(2);
        return RawMessage{messages_->integer(0),
                          topics_.at(messages_->integer(1)).topic,
                          {blob.begin(), blob.end()}};
      }
    } catch (const LogError& error) {
      throw LogError(std::string(error.what()) +
                     "; the log breaks off here, what came before was read");
    }
    if (damaged_) {
      throw LogError(file_ +
                     ": the log breaks off here, the file is damaged; what came before was read");
    }
    return std::nullopt;
  }

 private:
  static void check_header(const fs::path& file) {
    if (fs::file_size(file) == 0) {
      throw LogError(file.string() + ": the file is empty");
    }
  }

  void open(bool repair) {
    damaged_ = repair;
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
    try {
      count();
    } catch (const LogError&) {
      if (!repair) {
        throw;
      }
    }
  }

  /// Walks over the messages without their data. In a damaged file it stops where that breaks.
  void count() {
    auto rows =
        database_->prepare("SELECT topic_id, timestamp FROM messages NOT INDEXED ORDER BY id");
    while (rows.step()) {
      const auto topic = topics_.find(rows.integer(0));
      if (topic == topics_.end()) {
        continue;  // where a file is cut off SQLite may hand out a row of zeros
      }
      const Nanoseconds time_ns = rows.integer(1);
      first_ns_ = first_ns_ == 0 ? time_ns : std::min(first_ns_, time_ns);
      last_ns_ = std::max(last_ns_, time_ns);
      ++topic->second.messages;
    }
  }

  std::string file_;
  bool damaged_{false};
  std::optional<Database> database_;
  std::optional<Statement> messages_;
  std::map<std::int64_t, TopicSummary> topics_;
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
      if (auto raw = files_[at_]->next()) {
        return raw;
      }
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
  }

  // Statements refer to their database: neither may move.
  std::vector<std::unique_ptr<Db3>> files_;
  std::size_t at_{0};
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
