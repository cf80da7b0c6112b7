// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "db3_file.hpp"

#include "sqlite.hpp"
#include "sqlite_salvage.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

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
class Db3 : public BagFile {
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

  std::vector<TopicSummary> topics() const override {
    std::vector<TopicSummary> topics;
    for (const auto& [id, topic] : topics_) {
      topics.push_back(topic);
    }
    return topics;
  }

  std::optional<Nanoseconds> first_ns() const override { return first_ns_; }

  Nanoseconds last_ns() const override { return last_ns_; }

  std::vector<std::string> faults() const override {
    if (!damage_.empty()) {
      return {damage_ + "; the file is cut off or damaged, " + std::to_string(counted()) +
              " messages can be read"};
    }
    std::error_code none;
    const auto log_bytes = fs::file_size(file_ + "-wal", none);
    if (none || log_bytes == 0) {
      return {};
    }
    return {file_ + ": has a write-ahead log of " + std::to_string(log_bytes) +
            " bytes beside it: its recorder was killed or still writes"};
  }

  void select(const std::set<std::string>& names) override {
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

  std::optional<RawMessage> next() override {
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
    first_ns_ = std::min(first_ns_.value_or(time_ns), time_ns);
    last_ns_ = std::max(last_ns_, time_ns);
    ++topic->second.messages;
  }

  void count_salvaged() {
    first_ns_.reset();
    last_ns_ = 0;
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
  std::optional<Nanoseconds> first_ns_;
  Nanoseconds last_ns_{0};
};

}  // namespace

std::unique_ptr<BagFile> open_db3_file(const fs::path& file) {
  return std::make_unique<Db3>(file);
}

}  // namespace trigpoint::recording
