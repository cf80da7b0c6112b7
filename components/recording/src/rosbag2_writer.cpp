// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "trigpoint/bus/cdr.hpp"

#include "bag_output.hpp"
#include "disk_reserve.hpp"
#include "rosbag2_metadata.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <utility>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

constexpr auto kCommitEvery = std::chrono::seconds(1);

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw LogError(folder.string() + ": cannot be created: " + error.message());
  }
}

/// Where a recording lies.
struct BagPlace {
  fs::path path;  ///< the folder, or the file when there is none
  fs::path file;
  bool in_folder{true};  ///< with metadata.yaml beside it
};

BagPlace new_folder(const fs::path& folder, const char* extension) {
  make_folder(folder);
  if (!fs::is_empty(folder)) {
    throw LogError(folder.string() +
                   ": is not empty; a recording is never written over another, name a new folder");
  }
  const fs::path path = fs::absolute(folder).lexically_normal();
  const auto name = path.has_filename() ? path.filename() : path.parent_path().filename();
  return {path, path / (name.string() + "_0" + extension), true};
}

BagPlace new_file(const fs::path& file) {
  const fs::path path = fs::absolute(file).lexically_normal();
  if (fs::exists(path)) {
    throw LogError(path.string() +
                   ": exists; a recording is never written over another, name a new file");
  }
  make_folder(path.parent_path());
  return {path, path, false};
}

BagPlace new_place(const fs::path& path, Storage storage) {
  if (names_mcap_file(path.string())) {
    return new_file(path);
  }
  return new_folder(path, storage == Storage::kMcap ? ".mcap" : ".db3");
}

std::string with_slash(const std::string& topic) {
  return topic.starts_with('/') ? topic : "/" + topic;
}

}  // namespace

bool names_mcap_file(const std::string& path) {
  return fs::path(path).extension() == ".mcap";
}

class Rosbag2Writer::Bag {
 public:
  Bag(const BagPlace& place, Storage storage, std::uint64_t largest_bytes)
      : place_(place),
        storage_(storage),
        reserve_(place.file.string() + ".reserve"),
        output_(storage == Storage::kMcap ? create_mcap(place.file, largest_bytes)
                                          : create_db3(place.file, largest_bytes)) {}

  void declare(const std::string& topic, const std::string& type, Durability durability) {
    guarded([&] { topic_id(topic, type, durability); });
  }

  void write(const std::string& topic,
             const std::string& type,
             Nanoseconds receive_ns,
             std::span<const std::uint8_t> cdr) {
    guarded([&] {
      reserve_.hold(output_->closing_bytes(cdr.size()));
      const auto id = topic_id(topic, type, Durability::kVolatile);
      if (uncommitted_.empty()) {
        begun_ = std::chrono::steady_clock::now();
        begun_bytes_ = 0;
      }
      output_->add_message(id, receive_ns, cdr);
      ++uncommitted_[id];
      note_time(receive_ns);
      begun_bytes_ += cdr.size();
      if (begun_bytes_ >= kCommit_bytes ||
          std::chrono::steady_clock::now() - begun_ >= kCommitEvery) {
        commit();
        output_->settle();
      }
    });
  }

  void flush() {
    guarded([&] {
      commit();
      output_->settle();
    });
  }

  void close() {
    if (!output_) {
      return;
    }
    guarded([&] {
      commit();
      output_->settle();
      reserve_.release();
      const Rosbag2Metadata metadata = describe();
      output_->finish(storage_ == Storage::kMcap ? to_bare_yaml(metadata) : to_yaml(metadata));
      output_.reset();
      write_metadata(metadata);
    });
  }

  std::uint64_t messages() const { return messages_; }

 private:
  /// Runs one operation; after a failure the bag is closed with what is durable in it.
  template <class Operation>
  void guarded(Operation operation) {
    if (!output_) {
      throw LogError(place_.path.string() + ": the recording is closed already");
    }
    try {
      operation();
    } catch (const LogError& error) {
      abandon();
      throw LogError(std::string(error.what()) + "; the recording ends here with " +
                     std::to_string(messages_) + " messages, which stay readable");
    }
  }

  void commit() {
    const bool kept = output_->commit();
    if (kept) {
      durable_last_ns_ = last_ns_;
    }
    for (auto& topic : topics_) {
      const auto waiting = uncommitted_[ids_.at(topic.name)];
      topic.messages += kept ? waiting : 0;
      messages_ += kept ? waiting : 0;
    }
    uncommitted_.clear();
  }

  std::int64_t topic_id(const std::string& topic, const std::string& type, Durability durability) {
    const std::string name = with_slash(topic);
    const auto found = ids_.find(name);
    if (found != ids_.end()) {
      return found->second;
    }
    const Rosbag2Topic added{name, type, offered_qos(durability), 0};
    const std::int64_t id = output_->add_topic(added);
    topics_.push_back(added);
    return ids_[name] = id;
  }

  void note_time(Nanoseconds receive_ns) {
    first_ns_ = std::min(first_ns_.value_or(receive_ns), receive_ns);
    last_ns_ = std::max(last_ns_, receive_ns);
  }

  Rosbag2Metadata describe() const {
    Rosbag2Metadata metadata;
    metadata.storage = storage_ == Storage::kMcap ? "mcap" : "sqlite3";
    metadata.start_ns = first_ns_.value_or(0);
    metadata.duration_ns = std::max<Nanoseconds>(0, durable_last_ns_ - metadata.start_ns);
    metadata.files = {place_.file.filename().string()};
    metadata.topics = topics_;
    return metadata;
  }

  void write_metadata(const Rosbag2Metadata& metadata) {
    if (!place_.in_folder) {
      return;
    }
    const auto file = place_.path / "metadata.yaml";
    std::ofstream stream(file);
    stream << to_yaml(metadata);
    stream.close();
    if (!stream) {
      throw LogError(file.string() + ": cannot be written; is the disk full?");
    }
  }

  /// After a failure: keeps what fits. What is not committed is lost, or it still fits now; then
  /// there is room for nothing more.
  void abandon() noexcept {
    if (!output_) {
      return;
    }
    reserve_.release();
    try {
      commit();
    } catch (...) {
      uncommitted_.clear();
    }
    try {
      output_->finish(std::nullopt);
      write_metadata(describe());
    } catch (...) {
      // What is committed is readable without them.
    }
    output_.reset();
  }

  BagPlace place_;
  Storage storage_;
  DiskReserve reserve_;
  std::unique_ptr<BagOutput> output_;
  std::map<std::string, std::int64_t> ids_;
  std::map<std::int64_t, std::uint64_t> uncommitted_;  ///< messages by topic
  std::vector<Rosbag2Topic> topics_;
  std::optional<Nanoseconds> first_ns_;
  Nanoseconds last_ns_{0};
  Nanoseconds durable_last_ns_{0};
  std::uint64_t messages_{0};
  std::chrono::steady_clock::time_point begun_;
  std::uint64_t begun_bytes_{0};  ///< written since then
};

Rosbag2Writer::Rosbag2Writer(const std::string& path, Storage storage, std::uint64_t largest_bytes)
    : bag_(std::make_unique<Bag>(new_place(path, storage),
                                 names_mcap_file(path) ? Storage::kMcap : storage,
                                 largest_bytes)) {}

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
