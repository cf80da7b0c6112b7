// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "trigpoint/bus/cdr.hpp"

#include "rosbag2_metadata.hpp"
#include "sqlite.hpp"
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <utility>

namespace trigpoint::recording {

namespace fs = std::filesystem;

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

constexpr auto kTransaction = std::chrono::seconds(1);
/// A transaction waits in the write-ahead log, which is emptied into the database after each: a log
/// that grew with the drive could not be emptied any more on a full disk.
constexpr std::uint64_t kTransaction_bytes = 4U << 20U;
/// Kept free for emptying the write-ahead log once more when the disk is full: what it may hold,
/// and as much again for pages of the index, metadata.yaml and SQLite's shared memory.
constexpr std::uint64_t kReserveOverTransaction = 2;

/// Room on the disk that belongs to nobody else until it is given back: a file without a name,
/// which also vanishes with a killed process.
class DiskReserve {
 public:
  explicit DiskReserve(const fs::path& folder) : name_((folder / "reserve").string()) {}

  ~DiskReserve() { release(); }

  DiskReserve(const DiskReserve&) = delete;
  DiskReserve& operator=(const DiskReserve&) = delete;

  /// Throws LogError when the disk has not so much left.
  void hold(std::uint64_t bytes) {
    if (bytes <= bytes_) {
      return;
    }
    if (file_ < 0) {
      file_ = ::open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
      ::unlink(name_.c_str());
    }
    const int error = file_ < 0 ? errno : ::posix_fallocate(file_, 0, static_cast<off_t>(bytes));
    if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
      throw LogError(name_ + ": " + std::to_string(bytes) +
                     " bytes can't be kept free for the end: " + std::strerror(error));
    }
    bytes_ = bytes;  // where a file system refuses for another reason there is no reserve
  }

  void release() {
    if (file_ >= 0) {
      ::close(std::exchange(file_, -1));
    }
  }

 private:
  std::string name_;
  int file_{-1};
  std::uint64_t bytes_{0};
};

fs::path new_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw LogError(folder.string() + ": cannot be created: " + error.message());
  }
  if (!fs::is_empty(folder)) {
    throw LogError(folder.string() +
                   ": is not empty; a recording is never written over another, name a new folder");
  }
  return fs::absolute(folder).lexically_normal();
}

std::string file_name(const fs::path& folder) {
  const auto name = folder.has_filename() ? folder.filename() : folder.parent_path().filename();
  return name.string() + "_0.db3";
}

std::string with_slash(const std::string& topic) {
  return topic.starts_with('/') ? topic : "/" + topic;
}

}  // namespace

class Rosbag2Writer::Bag {
 public:
  Bag(const std::string& folder, std::uint64_t largest_bytes)
      : folder_(new_folder(folder)),
        reserve_(folder_),
        database_(std::in_place,
                  (folder_ / file_name(folder_)).string(),
                  SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE) {
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

  void declare(const std::string& topic, const std::string& type, Durability durability) {
    guarded([&] { topic_id(topic, type, durability); });
  }

  void write(const std::string& topic,
             const std::string& type,
             Nanoseconds receive_ns,
             std::span<const std::uint8_t> cdr) {
    guarded([&] {
      reserve_.hold(kReserveOverTransaction * (kTransaction_bytes + cdr.size()));
      begin();
      const auto id = topic_id(topic, type, Durability::kVolatile);
      insert_->bind(1, id).bind(2, receive_ns).bind(3, cdr).step();
      insert_->reset();
      ++unflushed_[id];
      note_time(receive_ns);
      begun_bytes_ += cdr.size();
      if (begun_bytes_ >= kTransaction_bytes ||
          std::chrono::steady_clock::now() - begun_ >= kTransaction) {
        commit();
        empty_write_ahead_log();
      }
    });
  }

  void flush() {
    guarded([&] {
      commit();
      empty_write_ahead_log();
    });
  }

  void close() {
    if (!database_) {
      return;
    }
    guarded([&] {
      commit();
      empty_write_ahead_log();
      reserve_.release();
      insert_.reset();
      const Rosbag2Metadata metadata = describe();
      database_->prepare("INSERT INTO metadata(metadata_version, metadata) VALUES (5, ?)")
          .bind(1, to_yaml(metadata))
          .step();
      finish_file();
      write_metadata(metadata);
    });
  }

  std::uint64_t messages() const { return messages_; }

 private:
  /// Runs one operation; after a failure the bag is closed with what is durable in it.
  template <class Operation>
  void guarded(Operation operation) {
    if (!database_) {
      throw LogError(folder_.string() + ": the recording is closed already");
    }
    try {
      operation();
    } catch (const LogError& error) {
      abandon();
      throw LogError(std::string(error.what()) + "; the recording ends here with " +
                     std::to_string(messages_) + " messages, which stay readable");
    }
  }

  void begin() {
    if (!database_->in_transaction()) {
      database_->run("BEGIN");
      begun_ = std::chrono::steady_clock::now();
      begun_bytes_ = 0;
    }
  }

  /// Into the database. A reader may hold it up; then the next time does it.
  void empty_write_ahead_log() { database_->run("PRAGMA wal_checkpoint(PASSIVE)"); }

  /// SQLite may have rolled the transaction back by itself; then what waited in it is lost.
  void commit() {
    const bool open = database_->in_transaction();
    if (open) {
      database_->run("COMMIT");
      durable_last_ns_ = last_ns_;
    }
    for (auto& topic : topics_) {
      const auto waiting = std::exchange(unflushed_[ids_.at(topic.name)], 0);
      topic.messages += open ? waiting : 0;
      messages_ += open ? waiting : 0;
    }
  }

  std::int64_t topic_id(const std::string& topic, const std::string& type, Durability durability) {
    const std::string name = with_slash(topic);
    const auto found = ids_.find(name);
    if (found != ids_.end()) {
      return found->second;
    }
    const std::string qos = offered_qos(durability);
    database_
        ->prepare(
            "INSERT INTO topics(name, type, serialization_format, offered_qos_profiles) VALUES (?, "
            "?, 'cdr', ?)")
        .bind(1, name)
        .bind(2, type)
        .bind(3, qos)
        .step();
    topics_.push_back({name, type, qos, 0});
    return ids_[name] = database_->last_row();
  }

  void note_time(Nanoseconds receive_ns) {
    first_ns_ = std::min(first_ns_.value_or(receive_ns), receive_ns);
    last_ns_ = std::max(last_ns_, receive_ns);
  }

  Rosbag2Metadata describe() const {
    Rosbag2Metadata metadata;
    metadata.start_ns = first_ns_.value_or(0);
    metadata.duration_ns = std::max<Nanoseconds>(0, durable_last_ns_ - metadata.start_ns);
    metadata.files = {file_name(folder_)};
    metadata.topics = topics_;
    return metadata;
  }

  /// A file that is not in WAL mode also opens on a read-only disk.
  void finish_file() {
    database_->run("PRAGMA journal_mode=DELETE");
    database_.reset();
  }

  void write_metadata(const Rosbag2Metadata& metadata) {
    const auto file = folder_ / "metadata.yaml";
    std::ofstream stream(file);
    stream << to_yaml(metadata);
    stream.close();
    if (!stream) {
      throw LogError(file.string() + ": cannot be written; is the disk full?");
    }
  }

  /// After a failure: keeps what fits. SQLite rolls the open transaction back by itself or here, or
  /// its end still fits; then there is room for nothing more.
  void abandon() noexcept {
    try {
      reserve_.release();
      insert_.reset();
      if (database_) {
        commit();
        const Rosbag2Metadata metadata = describe();
        finish_file();
        write_metadata(metadata);
      }
    } catch (...) {
      database_.reset();
    }
  }

  fs::path folder_;
  DiskReserve reserve_;
  std::optional<Database> database_;
  std::optional<Statement> insert_;
  std::map<std::string, std::int64_t> ids_;
  std::map<std::int64_t, std::uint64_t> unflushed_;
  std::vector<Rosbag2Topic> topics_;
  std::optional<Nanoseconds> first_ns_;
  Nanoseconds last_ns_{0};
  Nanoseconds durable_last_ns_{0};
  std::uint64_t messages_{0};
  std::chrono::steady_clock::time_point begun_;
  std::uint64_t begun_bytes_{0};  ///< written since then
};

Rosbag2Writer::Rosbag2Writer(const std::string& folder, std::uint64_t largest_bytes)
    : bag_(std::make_unique<Bag>(folder, largest_bytes)) {}

Rosbag2Writer::~Rosbag2Writer() {
  try {
    bag_->close();
  } catch (const std::exception&) {
    // A destructor can't report; what is durable stays.
  }
}

template <class Plain>
void Rosbag2Writer::write(const std::string& topic, Nanoseconds receive_ns, const Plain& message) {
  bag_->write(topic, bus::ros_type_name<Plain>(), receive_ns, bus::encode_cdr(message));
}

template void Rosbag2Writer::write(const std::string&, Nanoseconds, const ImuSample&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const GnssFix&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const PointCloudMessage&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const TwistMeasurement&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const YawMeasurement&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const Odometry&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const Datum&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const GpsStatus&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const LioStatus&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const StateUpdate&);
template void Rosbag2Writer::write(const std::string&, Nanoseconds, const FusionStatus&);

void Rosbag2Writer::write_cdr(const std::string& topic,
                              const std::string& ros_type,
                              Nanoseconds receive_ns,
                              std::span<const std::uint8_t> cdr) {
  bag_->write(topic, ros_type, receive_ns, cdr);
}

void Rosbag2Writer::declare_topic(const std::string& topic,
                                  const std::string& ros_type,
                                  Durability durability) {
  bag_->declare(topic, ros_type, durability);
}

void Rosbag2Writer::flush() {
  bag_->flush();
}

void Rosbag2Writer::close() {
  bag_->close();
}

std::uint64_t Rosbag2Writer::messages_written() const {
  return bag_->messages();
}

}  // namespace trigpoint::recording
