// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The mapper as a program on the bus with a session on disk: killed in the middle of a drive and
// started again; and with a disk that does not answer.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/participant_of.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::Command;
using tests::CommandResult;
using tests::TemporaryFolder;
namespace topics = bus::topics;

const std::string kScenario = "short";
constexpr double kDrive_s = 14.0;
constexpr double kKill_s = 7.0;  ///< on a straight: a second later it has not turned by 30 degrees
constexpr double kHang_s = 5.0;
constexpr double kDead_s = 0.7;  ///< of the drive, unseen; the robot goes on at 3 m/s
/// Against the truth, by the frame of the first pose; 2 cm are usual.
constexpr double kPosition_m = 0.15;
/// Sweeps that a mapper may receive and not use when it goes on: one begins before its IMU does.
constexpr std::uint64_t kFirstSweeps = 2;
/// Scans between publishing and the disk at the kill: each takes about a millisecond there.
constexpr std::uint64_t kInFlight = 3;
constexpr auto kLimit = 60s;  ///< for anything that is waited for

std::string program(const std::string& name) {
  return std::string(TRIGPOINT_BIN_DIR) + "/" + name;
}

struct Heard {
  Odometry odometry;
  std::string writer;
};

/// What the mapper says on the bus.
class Ear {
 public:
  Ear()
      : participant_(bus::Config{}, "restart_test"),
        odometry_(
            participant_,
            topics::lio_odometry,
            [this](const nav_msgs::msg::Odometry& m, const bus::MessageInfo& info) {
              const std::scoped_lock lock(mutex_);
              odometries_.push_back({bus::from_message(m), bus::participant_of(info.writer_guid)});
              changed_.notify_all();
            }),
        status_(participant_,
                topics::lio_status,
                [this](const trigpoint_msgs::msg::LioStatus& m, const bus::MessageInfo&) {
                  const std::scoped_lock lock(mutex_);
                  statuses_.push_back(bus::from_message(m));
                  changed_.notify_all();
                }) {}

  std::vector<Heard> odometries() {
    const std::scoped_lock lock(mutex_);
    return odometries_;
  }

  std::vector<LioStatus> statuses() {
    const std::scoped_lock lock(mutex_);
    return statuses_;
  }

  bool wait_for_received(std::uint64_t n) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(
        lock, kLimit, [&] { return !statuses_.empty() && statuses_.back().scans_received >= n; });
  }

  bool wait_for_statuses(std::size_t n) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLimit, [&] { return statuses_.size() >= n; });
  }

  bool wait_for_odometries(std::size_t n) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLimit, [&] { return odometries_.size() >= n; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Heard> odometries_;
  std::vector<LioStatus> statuses_;
  bus::Participant participant_;
  bus::Subscription<nav_msgs::msg::Odometry> odometry_;
  bus::Subscription<trigpoint_msgs::msg::LioStatus> status_;
};

/// Puts a drive on the bus, each sweep when the mapper has taken the one before.
class Feed {
 public:
  explicit Feed(Ear& ear)
      : ear_(ear),
        participant_(bus::Config{}, "restart_test_feed"),
        points_(participant_, topics::points),
        imu_(participant_, topics::imu) {}

  /// So many mappers listen; one that was killed is gone after the lease.
  bool wait_for_readers(int n) const {
    const auto deadline = std::chrono::steady_clock::now() + kLimit;
    while (points_.matched() != n || imu_.matched() != n) {
      if (std::chrono::steady_clock::now() > deadline) {
        return false;
      }
      std::this_thread::sleep_for(20ms);
    }
    return true;
  }

  /// The mapper counts from here on.
  void expect_from(std::uint64_t received) { received_ = received; }

  bool send(const recording::LogEntry& entry) {
    if (const auto* sample = std::get_if<ImuSample>(&entry.measurement)) {
      imu_.publish(bus::to_message(*sample));
    } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry.measurement)) {
      points_.publish(bus::to_message(*cloud));
      ++sweeps_;
      return ear_.wait_for_received(++received_);
    }
    return true;
  }

  std::uint64_t sweeps() const { return sweeps_; }

 private:
  Ear& ear_;
  bus::Participant participant_;
  bus::Publisher<sensor_msgs::msg::PointCloud2> points_;
  bus::Publisher<sensor_msgs::msg::Imu> imu_;
  std::uint64_t received_{0};
  std::uint64_t sweeps_{0};
};

/// A mapper with a session, on a domain of its own, and somebody who listens.
class MapperOnTheBus : public ::testing::Test {
 protected:
  MapperOnTheBus() {
    static int cases = 0;
    const std::string domain = tests::own_domain(40 + cases++);
    setenv("ROS_DOMAIN_ID", domain.c_str(), 1);
    ear_.emplace();
    feed_.emplace(*ear_);
    const CommandResult config =
        tests::run_command({program("trigpoint"), "config", "--for", kScenario});
    tests::write_file(folder_.path("config.yaml"), config.output);
    std::filesystem::create_directory(session());
    reader_ = simulator::open_scenario(simulator::load_scenario(kScenario), 1, kDrive_s);
  }

  std::string session() const { return folder_.path("session"); }

  std::string store() const { return session() + "/" + exporter::session_file::kKeyframes; }

  /// Starts a mapper and waits until it hears and is heard.
  void start(std::optional<Command>& mapper) {
    mapper.emplace(std::vector<std::string>{program("trigpoint_lio_mapper"),
                                            "--config",
                                            folder_.path("config.yaml"),
                                            "--session",
                                            session()});
    const std::size_t heard = ear_->statuses().size();
    ASSERT_TRUE(feed_->wait_for_readers(1)) << mapper->output_so_far();
    ASSERT_TRUE(ear_->wait_for_statuses(heard + 1)) << mapper->output_so_far();
  }

  /// The drive's part that arrives in [from, to), s after its start.
  void drive(double from_s, double to_s) {
    while (auto entry = pending_ ? std::exchange(pending_, std::nullopt) : reader_->next()) {
      const double now_s = to_seconds(entry->receive_ns - reader_->summary().first_ns);
      if (now_s >= to_s) {
        pending_ = std::move(entry);
        return;
      }
      if (now_s >= from_s) {
        ASSERT_TRUE(feed_->send(*entry)) << "a sweep was not taken at " << now_s << " s";
      }
    }
  }

  /// Ends the mapper as a supervisor does.
  static CommandResult stop(Command& mapper) {
    mapper.signal(SIGTERM);
    return mapper.wait(kLimit);
  }

  static std::uint64_t counted(const LioStatus& status) {
    std::uint64_t refused = 0;
    for (const NamedCount& count : status.scans_refused) {
      refused += count.count;
    }
    return status.scans_used + refused;
  }

  TemporaryFolder folder_;
  std::optional<Ear> ear_;
  std::optional<Feed> feed_;
  std::unique_ptr<simulator::ScenarioReader> reader_;
  std::optional<recording::LogEntry> pending_;
};

struct Stored {
  lio_mapper::Checkpoint checkpoint;
  std::vector<std::uint64_t> ids;
};

Stored read(const std::string& store) {
  lio_mapper::KeyframeReader reader(store);
  Stored stored;
  stored.checkpoint = reader.checkpoint().value();
  reader.visit([&](const lio_mapper::Keyframe& k) { stored.ids.push_back(k.id); });
  return stored;
}

void expect_counted_from_zero(const Stored& stored) {
  ASSERT_EQ(stored.ids.size(), stored.checkpoint.next_keyframe);
  for (std::size_t i = 0; i < stored.ids.size(); ++i) {
    EXPECT_EQ(stored.ids[i], i);
  }
}

TEST_F(MapperOnTheBus, goes_on_in_the_same_odom_and_session_after_kill_9_in_the_middle_of_a_drive) {
  std::optional<Command> mapper;
  start(mapper);
  drive(0.0, kKill_s);
  kill(mapper->pid(), SIGKILL);
  mapper->wait(10s);
  ASSERT_TRUE(feed_->wait_for_readers(0));  // whatever was on its way has arrived, or never will
  const std::vector<Heard> before = ear_->odometries();
  const Stored killed = read(store());
  start(mapper);
  feed_->expect_from(killed.checkpoint.scans_received);
  drive(kKill_s + kDead_s, kDrive_s);
  const CommandResult ended = stop(*mapper);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("lio_resumed"));
  EXPECT_THAT(ended.output, Not(HasSubstr("lio_not_resumed")));

  // On the disk at the kill: all but what was on its way there.
  ASSERT_FALSE(before.empty());
  ASSERT_GE(killed.checkpoint.scans_used + kInFlight, before.size());
  expect_counted_from_zero(killed);
  ASSERT_GT(killed.ids.size(), 3U);

  const Stored all = read(store());
  expect_counted_from_zero(all);
  EXPECT_GT(all.ids.size(), killed.ids.size() + 3);
  EXPECT_EQ(all.checkpoint.odom_epoch, killed.checkpoint.odom_epoch);

  // Same odom: every pose fits the truth in the frame of the first one.
  const auto said = ear_->odometries();
  const auto truth = reader_->truth();
  const auto& [start_pose, writer] = said.front();
  const Pose T_map_odom =
      truth->at(start_pose.stamp_ns).T_map_base * start_pose.T_frame_child.inverse();
  double worst_m = 0.0;
  std::uint64_t after = 0;
  for (const Heard& heard : said) {
    const Pose T_map_base = T_map_odom * heard.odometry.T_frame_child;
    worst_m =
        std::max(worst_m, (T_map_base.p - truth->at(heard.odometry.stamp_ns).T_map_base.p).norm());
    after += heard.writer == writer ? 0 : 1;
  }
  std::printf("killed at %.0f s: %zu scans before, %llu after, worst %.3f m off\n",
              kKill_s,
              before.size(),
              static_cast<unsigned long long>(after),
              worst_m);
  EXPECT_LT(worst_m, kPosition_m);
  for (const LioStatus& status : ear_->statuses()) {
    EXPECT_EQ(status.odom_epoch, killed.checkpoint.odom_epoch);
  }
  // Every sweep that reached the second mapper was used, from its first ones on.
  const LioStatus last = ear_->statuses().back();
  const std::uint64_t received = last.scans_received - killed.checkpoint.scans_received;
  EXPECT_GE(after + kFirstSweeps, received);
  EXPECT_EQ(counted(last), last.scans_received);
  EXPECT_GE(last.scans_received + kInFlight, feed_->sweeps());
  // A pose is written before the checkpoint that counts it: the kill may fall between.
  const std::size_t written = exporter::read_trajectory(session() + "/lio.tum").size();
  EXPECT_GE(written, last.scans_used);
  EXPECT_LE(written, last.scans_used + kInFlight);
}

/// Keeps others from writing into a store, as a disk that hangs would.
class HeldStore {
 public:
  explicit HeldStore(const std::string& file) {
    EXPECT_EQ(sqlite3_open(file.c_str(), &database_), SQLITE_OK);
    sqlite3_busy_timeout(database_, 5000);
    EXPECT_EQ(sqlite3_exec(database_, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  }

  ~HeldStore() { sqlite3_close(database_); }

  HeldStore(const HeldStore&) = delete;
  HeldStore& operator=(const HeldStore&) = delete;

 private:
  sqlite3* database_{nullptr};
};

TEST_F(MapperOnTheBus, says_what_the_disk_refuses_and_goes_on_with_odometry) {
  std::optional<Command> mapper;
  start(mapper);
  drive(0.0, kHang_s);
  std::optional<HeldStore> held(std::in_place, store());
  drive(kHang_s, kHang_s + 3.0);  // the mapper takes every sweep, although nothing is written
  const CommandResult ended = stop(*mapper);
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("database is locked; going on without writing files"));
  EXPECT_GE(ear_->odometries().size() + kFirstSweeps, feed_->sweeps());
  held.reset();
  expect_counted_from_zero(read(store()));
}

TEST_F(MapperOnTheBus, does_not_wait_for_a_disk_that_hangs_and_writes_all_when_it_answers_again) {
  constexpr std::size_t kScansMeanwhile = 10;
  std::optional<Command> mapper;
  start(mapper);
  drive(0.0, kHang_s);
  {
    const HeldStore held(store());
    const std::size_t at_hang = ear_->odometries().size();
    drive(kHang_s, kHang_s + 0.1 * (kScansMeanwhile + 3));
    EXPECT_TRUE(ear_->wait_for_odometries(at_hang + kScansMeanwhile));
  }
  drive(kHang_s, kHang_s + 3.0);
  const CommandResult ended = stop(*mapper);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  const Stored stored = read(store());
  expect_counted_from_zero(stored);
  EXPECT_GE(stored.checkpoint.scans_used + kFirstSweeps, feed_->sweeps());
  EXPECT_EQ(exporter::read_trajectory(session() + "/lio.tum").size(), stored.checkpoint.scans_used);
}

}  // namespace
}  // namespace trigpoint
