// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/simulator.hpp"

#include "drive.hpp"
#include "fault_schedule.hpp"
#include "gnss_model.hpp"
#include "imu_model.hpp"
#include "lidar_model.hpp"
#include "path.hpp"
#include "relief.hpp"
#include "route.hpp"
#include "town.hpp"
#include "traffic.hpp"
#include "world.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

namespace trigpoint::simulator {

namespace {

using recording::LogEntry;

/// The world is the same every day; noise, vibration and traffic are not.
std::uint64_t seed_of_day(const Scenario& scenario, std::uint64_t seed) {
  return scenario.day == 0
             ? seed
             : derive_seed(derive_seed(seed, kDaySeed), static_cast<std::uint64_t>(scenario.day));
}

/// The moments at which one sensor measures.
class Epochs {
 public:
  Epochs(Nanoseconds first_ns, double rate_hz, Nanoseconds last_ns)
      : first_ns_(first_ns), rate_hz_(rate_hz), last_ns_(last_ns) {}

  Nanoseconds next_ns() const {
    return first_ns_ + from_seconds(static_cast<double>(count_) / rate_hz_);
  }

  bool is_over() const { return next_ns() > last_ns_; }

  Nanoseconds take() {
    const Nanoseconds stamp_ns = next_ns();
    ++count_;
    return stamp_ns;
  }

 private:
  Nanoseconds first_ns_;
  double rate_hz_;
  Nanoseconds last_ns_;
  std::int64_t count_{0};
};

/// An entry on its way; `order` settles equal arrivals.
struct Pending {
  LogEntry entry;
  std::uint64_t order{0};

  bool operator<(const Pending& other) const {  // the earliest in front of a heap
    return entry.receive_ns != other.entry.receive_ns ? entry.receive_ns > other.entry.receive_ns
                                                      : order > other.order;
  }
};

class Stream final : public ScenarioReader {
 public:
  Stream(const Scenario& scenario,
         std::uint64_t world_seed,
         double duration_s,
         const StreamOptions& options)
      : Stream(scenario, world_seed, seed_of_day(scenario, world_seed), duration_s, options) {}

 private:
  Stream(const Scenario& scenario,
         std::uint64_t world_seed,
         std::uint64_t seed,
         double duration_s,
         const StreamOptions& options)
      : scenario_(scenario),
        options_(options),
        relief_(scenario.world, world_seed),
        drive_(std::make_shared<Drive>(scenario, relief_, seed, duration_s)),
        earth_(scenario.datum, scenario.imu.earth_rotation),
        imu_(scenario.imu, seed),
        gnss_(scenario.gnss, scenario.datum, seed),
        lidar_(scenario.lidar, scenario.robot.T_base_lidar(), seed),
        faults_(scenario.faults, scenario.start_ns(), seed),
        imu_epochs_(scenario.start_ns(), scenario.imu.rate_hz, drive_->last_ns()),
        fix_epochs_(all_fix_epochs()),
        sweep_epochs_(scenario.start_ns() + from_seconds(scenario.lidar.first_sweep_s),
                      scenario.lidar.rate_hz,
                      options.lidar ? drive_->last_ns() - lidar_.sweep_ns() : 0) {
    if (options.lidar) {
      const Path path(scenario.route->points());
      world_.emplace(relief_,
                     build_town(scenario.world, path, relief_, world_seed),
                     drive_->track(1.0),
                     scenario.lidar.max_range_m + 10.0,
                     scenario.world.grass_height_m);
      populate(seed);
    }
    summarise();
  }

  /// The same traffic for any duration: it keeps clear of the whole drive.
  void populate(std::uint64_t seed) {
    const TrafficConfig& config = scenario_.traffic;
    if (config.walkers + config.crossing + config.cars > 0) {
      const Drive whole(
          scenario_, relief_, seed, std::max(scenario_.duration_s, drive_->duration_s()));
      traffic_.emplace(scenario_, relief_, whole, seed);
    }
  }

 public:
  const recording::LogSummary& summary() const override { return summary_; }

  std::optional<std::string> truth_file() const override { return truth_file_; }

  std::optional<RobotConfig> robot() const override { return scenario_.robot; }

  std::shared_ptr<const Truth> truth() const override { return drive_; }

  const Scenario& scenario() const override { return scenario_; }

  std::vector<FixTruth> true_fixes() const override {
    std::vector<FixTruth> fixes;
    for (Epochs epochs = all_fix_epochs(); !epochs.is_over();) {
      GnssEpoch epoch;
      epoch.stamp_ns = epochs.take();
      epoch.antenna_map_m =
          drive_->at(epoch.stamp_ns).T_map_base * scenario_.robot.antenna_position_base_m;
      epoch.gnss_class = scenario_.gnss.gnss_class;
      faults_.apply(epoch);
      fixes.push_back({epoch.stamp_ns,
                       epoch.antenna_map_m,
                       epoch.lost || epoch.gnss_class == "none",
                       epoch.gnss_class,
                       epoch.extra_error_m});
    }
    return fixes;
  }

  double progress() const override {
    const auto whole = static_cast<double>(drive_->last_ns() - drive_->first_ns());
    return std::clamp(static_cast<double>(newest_ns_ - drive_->first_ns()) / whole, 0.0, 1.0);
  }

  void write_truth(const std::string& path) override {
    simulator::write_truth(*drive_, scenario_.datum, path);
    truth_file_ = path;
    if (traffic_) {
      const std::filesystem::path folder = std::filesystem::path(path).parent_path();
      write_moving_objects(*traffic_, *drive_, (folder / "moving_objects.txt").string());
      moving_file_.open(folder / "moving_points.txt");
      moving_file_.precision(9);
      moving_file_ << "# points of moving objects: stamp_ns point object east_m north_m up_m\n";
    }
  }

  std::optional<LogEntry> next() override {
    while (make_what_may_come_first()) {
    }
    if (pending_.empty()) {
      newest_ns_ = drive_->last_ns();
      return std::nullopt;
    }
    std::pop_heap(pending_.begin(), pending_.end());
    LogEntry entry = std::move(pending_.back().entry);
    pending_.pop_back();
    newest_ns_ = entry.receive_ns;
    return entry;
  }

 private:
  static constexpr Nanoseconds kNever = std::numeric_limits<Nanoseconds>::max();

  static Nanoseconds arrival(const Epochs& epochs, double delay_s) {
    return epochs.is_over() ? kNever : epochs.next_ns() + from_seconds(delay_s);
  }

  /// Makes the measurement that can arrive first, unless something made already arrives before it.
  bool make_what_may_come_first() {
    const Nanoseconds imu_ns = arrival(imu_epochs_, scenario_.imu.transport_s);
    const Nanoseconds fix_ns =
        arrival(fix_epochs_,
                std::max(0.0,
                         scenario_.gnss.latency_s - scenario_.gnss.latency_jitter_s -
                             faults_.brings_forward_s()));
    const Nanoseconds sweep_ns = arrival(sweep_epochs_, sweep_delay_s());
    const Nanoseconds first_ns = std::min({imu_ns, fix_ns, sweep_ns});
    if (first_ns == kNever || (!pending_.empty() && pending_.front().entry.receive_ns < first_ns)) {
      return false;
    }
    if (first_ns == imu_ns) {
      make_imu();
    } else if (first_ns == fix_ns) {
      make_fix();
    } else {
      make_sweep();
    }
    return true;
  }

  Epochs all_fix_epochs() const {
    return {scenario_.start_ns() + from_seconds(scenario_.gnss.first_fix_s),
            scenario_.gnss.rate_hz,
            drive_->last_ns()};
  }

  double sweep_delay_s() const {
    return to_seconds(lidar_.sweep_ns()) + scenario_.lidar.transport_s;
  }

  void push(Nanoseconds receive_ns, recording::Measurement measurement) {
    pending_.push_back({LogEntry{receive_ns, std::move(measurement), false}, order_++});
    std::push_heap(pending_.begin(), pending_.end());
  }

  void make_imu() {
    const Nanoseconds stamp_ns = imu_epochs_.take();
    ImuEpoch epoch;
    epoch.sample = imu_.measure(ideal_imu(drive_->at(stamp_ns), earth_));
    epoch.sample.stamp_ns = stamp_ns;
    faults_.apply(epoch);
    if (epoch.lost) {
      return;
    }
    if (!epoch.frozen || !last_imu_) {
      last_imu_ = epoch.sample;
    }
    ImuSample sample = *last_imu_;
    sample.stamp_ns = stamp_ns + epoch.stamp_shift_ns;
    push(stamp_ns + from_seconds(scenario_.imu.transport_s), std::move(sample));
  }

  void make_fix() {
    const Nanoseconds stamp_ns = fix_epochs_.take();
    const Pose T_map_base = drive_->at(stamp_ns).T_map_base;
    GnssEpoch epoch = gnss_.begin(stamp_ns, T_map_base * scenario_.robot.antenna_position_base_m);
    faults_.apply(epoch);
    if (epoch.lost) {
      return;
    }
    const GnssFix fix = gnss_.finish(epoch);
    for (int copy = 0; copy <= epoch.copies; ++copy) {
      push(stamp_ns + from_seconds(epoch.latency_s + copy * epoch.copies_apart_s), fix);
    }
  }

  void make_sweep() {
    SweepEpoch epoch;
    epoch.stamp_ns = sweep_epochs_.take();
    faults_.apply(epoch);
    if (epoch.lost) {
      return;
    }
    MovingSweep moving;
    push(epoch.stamp_ns + from_seconds(sweep_delay_s()),
         lidar_.scan(epoch, *drive_, *world_, traffic_ ? &*traffic_ : nullptr, &moving));
    if (traffic_) {
      tell(moving);
    }
  }

  void tell(const MovingSweep& moving) {
    if (options_.on_moving) {
      options_.on_moving(moving);
    }
    if (!moving_file_.is_open()) {
      return;
    }
    for (const MovingPoint& point : moving.points) {
      moving_file_ << moving.stamp_ns << ' ' << point.point << ' ' << point.object << ' '
                   << point.p_map_m.x() << ' ' << point.p_map_m.y() << ' ' << point.p_map_m.z()
                   << '\n';
    }
    moving_file_.flush();
    if (!moving_file_) {
      throw std::runtime_error("moving_points.txt beside " + *truth_file_ +
                               " cannot be written (is the disk full?)");
    }
  }

  void summarise() {
    summary_.path = scenario_.name;
    summary_.format = "scenario";
    summary_.first_ns = drive_->first_ns();
    summary_.last_ns = drive_->last_ns();
    summary_.topics = {{scenario_.robot.imu_topic, "sensor_msgs/msg/Imu", count_imu()},
                       {scenario_.robot.fix_topic, "sensor_msgs/msg/NavSatFix", count_fixes()}};
    if (world_) {
      summary_.topics.push_back(
          {scenario_.robot.points_topic, "sensor_msgs/msg/PointCloud2", count_sweeps()});
    }
  }

  std::uint64_t count_imu() const {
    std::uint64_t count = 0;
    for (Epochs epochs = imu_epochs_; !epochs.is_over();) {
      ImuEpoch epoch;
      epoch.sample.stamp_ns = epochs.take();
      faults_.apply(epoch);
      count += epoch.lost ? 0 : 1;
    }
    return count;
  }

  std::uint64_t count_fixes() const {
    std::uint64_t count = 0;
    for (Epochs epochs = fix_epochs_; !epochs.is_over();) {
      GnssEpoch epoch;
      epoch.stamp_ns = epochs.take();
      epoch.gnss_class = scenario_.gnss.gnss_class;
      faults_.apply(epoch);
      count += epoch.lost ? 0U : 1U + static_cast<std::uint64_t>(epoch.copies);
    }
    return count;
  }

  std::uint64_t count_sweeps() const {
    std::uint64_t count = 0;
    for (Epochs epochs = sweep_epochs_; !epochs.is_over();) {
      SweepEpoch epoch;
      epoch.stamp_ns = epochs.take();
      faults_.apply(epoch);
      count += epoch.lost ? 0 : 1;
    }
    return count;
  }

  Scenario scenario_;
  StreamOptions options_;
  Relief relief_;
  std::shared_ptr<Drive> drive_;
  EarthAtDatum earth_;
  ImuModel imu_;
  GnssModel gnss_;
  SpinningLidar lidar_;
  FaultSchedule faults_;
  std::optional<World> world_;
  std::optional<Traffic> traffic_;
  std::ofstream moving_file_;
  std::optional<ImuSample> last_imu_;  ///< that was not frozen
  Epochs imu_epochs_;
  Epochs fix_epochs_;
  Epochs sweep_epochs_;
  std::vector<Pending> pending_;  ///< a heap, the earliest in front
  std::uint64_t order_{0};
  Nanoseconds newest_ns_{0};
  recording::LogSummary summary_;
  std::optional<std::string> truth_file_;
};

}  // namespace

std::unique_ptr<ScenarioReader> open_scenario(const Scenario& scenario,
                                              std::uint64_t seed,
                                              std::optional<double> duration_s,
                                              const StreamOptions& options) {
  return std::make_unique<Stream>(
      scenario, seed, duration_s.value_or(scenario.duration_s), options);
}

std::shared_ptr<const Truth> make_truth(const Scenario& scenario,
                                        std::uint64_t seed,
                                        std::optional<double> duration_s) {
  return std::make_shared<Drive>(scenario,
                                 Relief(scenario.world, seed),
                                 seed_of_day(scenario, seed),
                                 duration_s.value_or(scenario.duration_s));
}

}  // namespace trigpoint::simulator
