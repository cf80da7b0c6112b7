// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "kitti_reader.hpp"

#include "kitti_drive.hpp"
#include "skipped_messages.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

namespace trigpoint::recording {

namespace {

constexpr char kSweepTopic[] = "velodyne_points";
constexpr Nanoseconds kAfterLastSweep_ns = 200'000'000;

/// Where an entry's measurement is to be found; sweeps are read from disk when their turn comes.
struct Arrival {
  enum class Kind { kImu, kFix, kSweep };
  Nanoseconds receive_ns;
  Kind kind;
  std::size_t index;
};

class KittiReader : public LogReader {
 public:
  KittiReader(KittiDrive drive, const RobotConfig& robot, const LogOptions& options)
      : drive_(std::move(drive)), elevation_correction_rad_(options.elevation_correction_rad) {
    list_arrivals(options);
    summarize();
    note_missing_calibration(robot);
  }

  const LogSummary& summary() const override { return summary_; }

  std::optional<LogEntry> next() override {
    while (next_ < arrivals_.size()) {
      const Arrival& arrival = arrivals_[next_++];
      if (auto measurement = measured(arrival)) {
        return LogEntry{arrival.receive_ns, std::move(*measurement)};
      }
    }
    return std::nullopt;
  }

  double progress() const override {
    return arrivals_.empty() ? 1.0
                             : static_cast<double>(next_) / static_cast<double>(arrivals_.size());
  }

  std::vector<Undecodable> undecodable() const override { return skipped_.counts(); }

  Events take_events() override { return skipped_.take_events(); }

  std::optional<RobotConfig> robot() const override { return drive_.robot; }

 private:
  using Kind = Arrival::Kind;

  std::optional<Measurement> measured(const Arrival& arrival) {
    switch (arrival.kind) {
      case Kind::kImu:
        return drive_.imu[arrival.index];
      case Kind::kFix:
        return drive_.fixes[arrival.index];
      case Kind::kSweep:
        break;
    }
    try {
      return load_kitti_sweep(drive_.sweeps[arrival.index], elevation_correction_rad_);
    } catch (const LogError& error) {
      skipped_.add({"points", kSweepTopic, "its file is damaged"},
                   arrival.index + 1,
                   arrival.receive_ns,
                   error.what());
      return std::nullopt;
    }
  }

  void list_arrivals(const LogOptions& options) {
    add(Kind::kImu, drive_.imu);
    add(Kind::kFix, drive_.fixes);
    for (std::size_t i = 0; i < drive_.sweeps.size(); ++i) {
      arrivals_.push_back({drive_.sweeps[i].end_ns, Kind::kSweep, i});
    }
    if (!drive_.sweeps.empty()) {
      keep_between(drive_.sweeps.front().start_ns - from_seconds(options.lead_in_s),
                   drive_.sweeps.back().end_ns + kAfterLastSweep_ns);
    }
    // Equal times: IMU before fix before sweep, as the sources were added.
    std::stable_sort(arrivals_.begin(), arrivals_.end(), [](const Arrival& a, const Arrival& b) {
      return a.receive_ns < b.receive_ns;
    });
  }

  template <class Stamped>
  void add(Kind kind, const std::vector<Stamped>& measurements) {
    Nanoseconds newest_ns = 0;
    for (std::size_t i = 0; i < measurements.size(); ++i) {
      newest_ns = std::max(newest_ns, measurements[i].stamp_ns);
      arrivals_.push_back({newest_ns, kind, i});
    }
  }

  void keep_between(Nanoseconds first_ns, Nanoseconds last_ns) {
    std::erase_if(arrivals_, [&](const Arrival& arrival) {
      return arrival.receive_ns < first_ns || arrival.receive_ns > last_ns;
    });
  }

  std::uint64_t count(Kind kind) const {
    return static_cast<std::uint64_t>(
        std::count_if(arrivals_.begin(), arrivals_.end(), [&](const Arrival& arrival) {
          return arrival.kind == kind;
        }));
  }

  void summarize() {
    summary_.path = drive_.sync_folder.string();
    summary_.format = "kitti";
    summary_.topics = {{kSweepTopic, "sensor_msgs/msg/PointCloud2", count(Kind::kSweep)},
                       {drive_.imu_source, "sensor_msgs/msg/Imu", count(Kind::kImu)},
                       {"oxts position", "sensor_msgs/msg/NavSatFix", count(Kind::kFix)}};
    if (!arrivals_.empty()) {
      summary_.first_ns = arrivals_.front().receive_ns;
      summary_.last_ns = arrivals_.back().receive_ns;
    }
  }

  void note_missing_calibration(const RobotConfig& robot) {
    if (drive_.robot) {
      return;
    }
    const Eigen::Vector3d& p = robot.lidar_position_base_m;
    const Eigen::Vector3d& turn = robot.lidar_roll_pitch_yaw_base_rad;
    std::array<char, 200> assumed{};
    std::snprintf(assumed.data(),
                  assumed.size(),
                  "[%g, %g, %g] m, turned by [%g, %g, %g] rad",
                  p.x(),
                  p.y(),
                  p.z(),
                  turn.x(),
                  turn.y(),
                  turn.z());
    summary_.faults.push_back(
        drive_.sync_folder.string() +
        ": calib_imu_to_velo.txt is missing (neither here nor beside it): where the LiDAR sits is "
        "not known. Assumed from the configuration: robot.lidar_position_base_m " +
        assumed.data() + " against the IMU");
  }

  KittiDrive drive_;
  double elevation_correction_rad_;
  LogSummary summary_;
  std::vector<Arrival> arrivals_;
  SkippedMessages skipped_;
  std::size_t next_{0};
};

void require(bool needed, bool there, const std::filesystem::path& folder, const char* what) {
  if (needed && !there) {
    throw LogError(folder.string() + ": this KITTI drive has no " + what);
  }
}

}  // namespace

std::unique_ptr<LogReader> open_kitti_drive(const std::filesystem::path& sync_folder,
                                            const RobotConfig& robot,
                                            const LogOptions& options) {
  KittiDrive drive = load_kitti_drive(sync_folder);
  require(options.require_points,
          !drive.sweeps.empty(),
          sync_folder,
          "sweeps (velodyne_points/data/*.bin with lines in timestamps_start.txt)");
  require(
      options.require_imu, !drive.imu.empty(), sync_folder, "IMU (imu100.csv or oxts/data/*.txt)");
  require(options.require_fix, !drive.fixes.empty(), sync_folder, "fixes (oxts/data/*.txt)");
  require(options.require_aiding,
          robot.twist_topic.empty() && robot.yaw_topic.empty(),
          sync_folder,
          "wheels and no heading (robot.twist_topic, robot.yaw_topic)");
  return std::make_unique<KittiReader>(std::move(drive), robot, options);
}

}  // namespace trigpoint::recording
