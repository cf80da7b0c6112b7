// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bag_output.hpp"
#include "sqlite.hpp"

#include <algorithm>
#include <optional>

namespace trigpoint::recording {

namespace {

// rosbag2_storage_sqlite3 of ROS 2 Humble, schema version 3.
constexpr char kSchema[] =
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata "
    "TEXT NOT NULL);"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
    "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER "
    "NOT NULL, data BLOB NOT NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    "INSERT INTO schema(schema_version, ros_distro) VALUES (3, 'humble');";

/// Kept free for emptying the write-ahead log once more when the disk is full: what it may hold,
/// and as much again for pages of the index, metadata.yaml and SQLite's shared memory.
constexpr std::uint64_t kReserveOverTransaction = 2;

class Db3Output : public BagOutput {
 public:
  Db3Output(const std::string& file, std::uint64_t largest_bytes)
      : database_(std::in_place, file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE) {
    database_->run("PRAGMA journal_mode=WAL");
    database_->run("PRAGMA synchronous=NORMAL");
    if (largest_bytes > 0) {
      constexpr std::uint64_t kPageBytes = 4096;
      database_->run("PRAGMA max_page_count=" +
                     std::to_string(std::max<std::uint64_t>(largest_bytes / kPageBytes, 16)));
    }
    database_->run(kSchema);
    insert_.emplace(
        database_->prepare("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)"));
  }

  std::int64_t add_topic(const Rosbag2Topic& topic) override {
    database_
        ->prepare(
            "INSERT INTO topics(name, type, serialization_format, offered_qos_profiles) VALUES (?, "
            "?, 'cdr', ?)")
        .bind(1, topic.name)
        .bind(2, topic.type)
        .bind(3, topic.offered_qos_profiles)
        .step();
    return database_->last_row();
  }

  void add_message(std::int64_t topic,
                   Nanoseconds receive_ns,
                   std::span<const std::uint8_t> cdr) override {
    if (!database_->in_transaction()) {
      database_->run("BEGIN");
    }
    insert_->bind(1, topic).bind(2, receive_ns).bind(3, cdr).step();
    insert_->reset();
  }

  /// SQLite may have rolled the transaction back by itself.
  bool commit() override {
    insert_->reset();
    const bool open = database_->in_transaction();
    if (open) {
      database_->run("COMMIT");
    }
    return open;
  }

  /// A transaction waits in the write-ahead log, which is emptied into the database after each: a
  /// log that grew with the drive could not be emptied any more on a full disk. A reader may hold
  /// that up; then the next time does it.
  void settle() override { database_->run("PRAGMA wal_checkpoint(PASSIVE)"); }

  std::uint64_t closing_bytes(std::uint64_t message_bytes) const override {
    return kReserveOverTransaction * (kCommit_bytes + message_bytes);
  }

  /// A file that is not in WAL mode also opens on a read-only disk.
  void finish(const std::optional<std::string>& metadata) override {
    insert_.reset();
    if (metadata) {
      database_->prepare("INSERT INTO metadata(metadata_version, metadata) VALUES (5, ?)")
          .bind(1, *metadata)
          .step();
    }
    database_->run("PRAGMA journal_mode=DELETE");
    database_.reset();
  }

 private:
  std::optional<Database> database_;
  std::optional<Statement> insert_;
};

}  // namespace

std::unique_ptr<BagOutput> create_db3(const std::filesystem::path& file,
                                      std::uint64_t largest_bytes) {
  return std::make_unique<Db3Output>(file.string(), largest_bytes);
}

}  // namespace trigpoint::recording
