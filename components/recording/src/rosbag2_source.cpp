// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rosbag2_source.hpp"

#include "trigpoint/bus/cdr.hpp"

#include "db3_file.hpp"
#include "mcap_file.hpp"
#include "ros1_messages.hpp"
#include "rosbag2_metadata.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
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
  const bool known = metadata.storage == "sqlite3" || metadata.storage == "mcap";
  if (!known || !metadata.compression_format.empty()) {
    throw LogError(folder.string() + ": a rosbag2 of storage '" + metadata.storage + "'" +
                   (metadata.compression_format.empty()
                        ? ""
                        : " compressed with " + metadata.compression_format) +
                   "; only sqlite3 and mcap are read here, and neither when rosbag2 has compressed "
                   "their files or messages. `ros2 bag convert` makes one");
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

std::vector<fs::path> files_in(const fs::path& folder, const char* extension) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == extension) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end(), before);
  return files;
}

std::unique_ptr<BagFile> open_file(const fs::path& file) {
  return is_mcap(file) ? open_mcap_file(file) : open_db3_file(file);
}

/// The files of a bag, their messages in one order of time.
class Rosbag2Source : public BagSource {
 public:
  Rosbag2Source(const fs::path& path, const std::vector<fs::path>& files) {
    for (const auto& file : files) {
      files_.push_back(open_file(file));
      ros1_topics_.merge(files_.back()->ros1_topics());
    }
    summarize(path);
    order_.resize(files_.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [this](std::size_t a, std::size_t b) {
      return files_[a]->first_ns() < files_[b]->first_ns();
    });
  }

  const LogSummary& summary() const override { return summary_; }

  void select(const std::vector<std::string>& topics) override {
    for (auto& file : files_) {
      file->select({topics.begin(), topics.end()});
    }
  }

  std::optional<RawMessage> next() override {
    while (begun_ < order_.size() && (waiting_.empty() || files_[order_[begun_]]->first_ns() <=
                                                              waiting_.begin()->first.first)) {
      wait_for(order_[begun_++]);
    }
    if (waiting_.empty()) {
      if (!damage_.empty()) {
        throw LogError(damage_);
      }
      return std::nullopt;
    }
    auto first = waiting_.extract(waiting_.begin());
    wait_for(first.key().second);
    return std::move(first.mapped());
  }

  bool decode(const RawMessage& raw, ImuSample& imu) const override { return decode_any(raw, imu); }

  bool decode(const RawMessage& raw, GnssFix& fix) const override { return decode_any(raw, fix); }

  bool decode(const RawMessage& raw, PointCloudMessage& cloud) const override {
    return decode_any(raw, cloud);
  }

  bool decode(const RawMessage& raw, TwistMeasurement& twist) const override {
    return decode_any(raw, twist);
  }

  bool decode(const RawMessage& raw, Odometry& odometry) const override {
    return decode_any(raw, odometry);
  }

  bool decode(const RawMessage& raw, YawMeasurement& yaw) const override {
    return decode_any(raw, yaw);
  }

 private:
  template <class Message>
  bool decode_any(const RawMessage& raw, Message& message) const {
    return ros1_topics_.count(raw.topic) > 0 ? decode_ros1(raw.bytes, message)
                                             : bus::decode_cdr(raw.bytes, message);
  }

  /// The file's next message; where it breaks off, the bag's other files may be whole.
  void wait_for(std::size_t file) {
    try {
      if (auto raw = files_[file]->next()) {
        const Nanoseconds receive_ns = raw->receive_ns;
        waiting_.emplace(std::pair(receive_ns, file), std::move(*raw));
      }
    } catch (const LogError& error) {
      damage_ += (damage_.empty() ? "" : "\n") + std::string(error.what());
    }
  }

  void summarize(const fs::path& path) {
    summary_.path = path.string();
    summary_.format = fs::is_regular_file(path) && is_mcap(path) ? "mcap" : "rosbag2";
    std::map<std::string, TopicSummary> topics;
    std::optional<Nanoseconds> first_ns;
    for (const auto& file : files_) {
      for (const TopicSummary& topic : file->topics()) {
        auto& sum = topics[topic.topic];
        sum = {topic.topic, topic.type, sum.messages + topic.messages};
      }
      if (const auto begin_ns = file->first_ns()) {
        first_ns = std::min(first_ns.value_or(*begin_ns), *begin_ns);
        summary_.last_ns = std::max(summary_.last_ns, file->last_ns());
      }
    }
    summary_.first_ns = first_ns.value_or(0);
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
      for (std::string& fault : file->faults()) {
        summary_.faults.push_back(std::move(fault));
      }
    }
  }

  std::vector<std::unique_ptr<BagFile>> files_;
  std::set<std::string> ros1_topics_;
  std::vector<std::size_t> order_;  ///< files by their first message
  std::size_t begun_{0};            ///< so many of them
  std::map<std::pair<Nanoseconds, std::size_t>, RawMessage> waiting_;  ///< one of each file begun
  std::string damage_;
  LogSummary summary_;
};

}  // namespace

std::vector<fs::path> find_rosbag2_files(const fs::path& path) {
  if (fs::is_regular_file(path)) {
    return path.extension() == ".db3" || is_mcap(path) ? std::vector{path}
                                                       : std::vector<fs::path>{};
  }
  if (fs::is_regular_file(path / "metadata.yaml")) {
    return listed(path, read_metadata(path / "metadata.yaml"));
  }
  auto files = files_in(path, ".db3");
  return files.empty() ? files_in(path, ".mcap") : files;
}

std::unique_ptr<BagSource> open_rosbag2(const fs::path& path, const std::vector<fs::path>& files) {
  return std::make_unique<Rosbag2Source>(path, files);
}

}  // namespace trigpoint::recording
