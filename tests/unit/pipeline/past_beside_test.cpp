// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/past_beside.hpp"

#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "../export/scratch_folder.hpp"
#include "../lio_mapper/room_drive.hpp"
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

namespace trigpoint::pipeline {
namespace {

using lio_mapper::testing_support::RoomDrive;
using test::ScratchFolder;

/// So far goes the drive that is made once: a lap and a half of the hall, 50 m each.
constexpr int kSweeps = 420;
constexpr std::size_t kAdoptAfter = 20;

struct Input {
  std::vector<ImuSample> imu;
  PointCloudMessage cloud;
};

const std::vector<Input>& inputs() {
  static const std::vector<Input> made = [] {
    constexpr Nanoseconds kImuPeriod_ns = 5'000'000;
    constexpr int kImuPerSweep = 20;
    const RoomDrive room(0.5, 3.0);
    std::vector<Input> all;
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      const Nanoseconds begin_ns = RoomDrive::kEpoch_ns + sweep * kImuPerSweep * kImuPeriod_ns;
      Input input;
      for (int i = 0; i < kImuPerSweep; ++i) {
        input.imu.push_back(room.imu_at(begin_ns + i * kImuPeriod_ns));
      }
      input.cloud = room.sweep_at(begin_ns, 120);
      all.push_back(std::move(input));
    }
    return all;
  }();
  return made;
}

using Jobs = std::vector<std::function<void()>>;

/// A mapper with a store and its past beside it.
class Drive {
 public:
  explicit Drive(const PastBesideOptions& options, Jobs* withheld = nullptr)
      : writer_(folder_.file("keyframes.sqlite")),
        past(
            mapper_,
            folder_.file("keyframes.sqlite"),
            {},
            [withheld](std::function<void()> job) {
              if (withheld) {
                withheld->push_back(std::move(job));
              } else {
                job();
              }
            },
            options) {}

  void step(const Input& input) {
    std::size_t scans = 0;
    const auto take = [&](lio_mapper::Output output) {
      for (lio_mapper::ScanResult& scan : output.scans) {
        writer_.commit(scan.checkpoint, scan.rows, scan.keyframe);
        poses.push_back(scan.odometry.T_frame_child);
        ++scans;
      }
    };
    for (const ImuSample& sample : input.imu) {
      take(mapper_.on_imu(sample));
    }
    take(mapper_.on_cloud(input.cloud));
    for (Event& event : past.after_scans(scans)) {
      events.push_back(std::move(event));
      told_after.push_back(poses.size());
    }
  }

  void run() {
    for (const Input& input : inputs()) {
      step(input);
    }
  }

 private:
  static lio_mapper::Config config() {
    lio_mapper::Config config;
    config.past.enabled = true;
    config.past.interval_s = 5.0;
    return config;
  }

  ScratchFolder folder_;
  lio_mapper::KeyframeWriter writer_;
  lio_mapper::LioMapper mapper_{config(), RobotConfig{}};

 public:
  PastBeside past;
  std::vector<Pose> poses;
  Events events;
  std::vector<std::size_t> told_after;  ///< scans
};

TEST(PastBeside, corrects_a_lap_that_is_driven_again_and_says_so) {
  Drive drive({kAdoptAfter, 0});
  drive.run();
  ASSERT_GE(drive.events.size(), 1U);
  EXPECT_EQ(drive.events[0].code, "past_corrected") << drive.events[0].text;
  EXPECT_EQ(drive.events[0].text.find("place_revisited"), 0U) << drive.events[0].text;
  EXPECT_EQ(drive.past.corrections(), drive.events.size());
  EXPECT_GT(drive.past.longest_hold_s(), 0.0);
}

TEST(PastBeside, gives_the_same_bits_when_it_adopts_at_fixed_scans) {
  Drive a({kAdoptAfter, 0});
  a.run();
  Drive b({kAdoptAfter, 0});
  b.run();
  EXPECT_EQ(a.told_after, b.told_after);
  ASSERT_EQ(a.poses.size(), b.poses.size());
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    ASSERT_EQ(a.poses[i].p, b.poses[i].p) << i;
    ASSERT_EQ(a.poses[i].q.coeffs(), b.poses[i].q.coeffs()) << i;
  }
}

// The disk does not get on: no scan waits for the correction.
TEST(PastBeside, lets_scans_pass_while_a_correction_is_not_ready) {
  Jobs withheld;
  Drive drive({std::nullopt, 0}, &withheld);
  drive.run();
  EXPECT_EQ(withheld.size(), 1U) << "one at a time";
  EXPECT_GE(drive.poses.size(), inputs().size() - 2);
  EXPECT_TRUE(drive.events.empty());
}

TEST(PastBeside, adopts_as_soon_as_it_is_ready_and_catches_up_beside_the_mapper) {
  Jobs withheld;
  Drive drive({std::nullopt, 5}, &withheld);
  std::size_t began_after = 0;
  for (const Input& input : inputs()) {
    drive.step(input);
    if (withheld.size() == 1 && began_after == 0) {
      began_after = drive.poses.size();
    }
    // A second of scans later the store is there; then scans come no faster than in a real drive
    // of ten times this speed.
    if (began_after != 0 && drive.poses.size() == began_after + 10) {
      withheld[0]();
    }
    if (began_after != 0 && drive.poses.size() > began_after + 10 && drive.events.empty()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  ASSERT_FALSE(drive.events.empty());
  EXPECT_EQ(drive.events[0].code, "past_corrected") << drive.events[0].text;
  EXPECT_GT(drive.told_after[0], began_after + 10);
}

TEST(PastBeside, leaves_the_map_as_it_is_when_the_store_refuses) {
  Jobs withheld;
  Drive drive({std::nullopt, 0}, &withheld);
  for (const Input& input : inputs()) {
    drive.step(input);
    withheld.clear();  // thrown away undone
  }
  ASSERT_FALSE(drive.events.empty());
  for (const Event& event : drive.events) {
    EXPECT_EQ(event.code, "past_not_corrected");
    EXPECT_NE(event.text.find("store"), std::string::npos) << event.text;
  }
  EXPECT_EQ(drive.past.corrections(), 0U);
}

TEST(PastBeside, ends_at_once_when_it_is_cancelled) {
  Jobs withheld;
  auto drive = std::make_unique<Drive>(PastBesideOptions{std::nullopt, 0}, &withheld);
  drive->run();
  ASSERT_EQ(withheld.size(), 1U);
  drive->past.cancel();
  withheld[0]();
  EXPECT_TRUE(drive->past.after_scans(1).empty());
  withheld.clear();
  drive.reset();  // waits for the thread
}

}  // namespace
}  // namespace trigpoint::pipeline
