// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/so3.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/pipeline/session_parts.hpp"

#include "../export/scratch_folder.hpp"
#include "resume_drive.hpp"
#include "stored_log.hpp"
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

namespace trigpoint::pipeline {
namespace {

using test::ScratchFolder;

/// What two mappers may differ by that saw the same scans against maps of different thinning.
constexpr double kSameTrack_m = 0.1;

const ResumeDrive& short_drive() {
  static const ResumeDrive drive("short", 1, 14.0);
  return drive;
}

TEST(Resume, goes_on_in_the_same_odom_after_a_restart_in_the_middle_of_a_drive) {
  const ResumeDrive& drive = short_drive();
  const auto& stopped = drive.scans.at(drive.scans.size() / 2);
  const auto resumed = resume(drive,
                              stopped.checkpoint,
                              drive.points_until(stopped.checkpoint.stamp_ns),
                              stopped.checkpoint.stamp_ns + from_seconds(0.7),
                              100.0);
  ASSERT_TRUE(said(resumed.events, "lio_resumed"));
  ASSERT_GT(resumed.scans.size(), drive.scans.size() / 3);
  double worst_m = 0.0;
  for (const auto& scan : resumed.scans) {
    const Pose* undisturbed = drive.pose_at(scan.odometry.stamp_ns);
    ASSERT_NE(undisturbed, nullptr);
    worst_m = std::max(worst_m, (scan.odometry.T_frame_child.p - undisturbed->p).norm());
    EXPECT_EQ(scan.status.odom_epoch, stopped.status.odom_epoch);
    EXPECT_GT(scan.status.scans_used, stopped.status.scans_used);
    if (scan.keyframe) {
      EXPECT_GE(scan.keyframe->id, stopped.checkpoint.next_keyframe);
    }
  }
  RecordProperty("worst_mm", static_cast<int>(1e3 * worst_m));
  EXPECT_LT(worst_m, kSameTrack_m);
  EXPECT_GT(resumed.scans.back().status.distance_m, stopped.status.distance_m);
}

/// A second without a mapper and a second until there are sweeps enough: more than the 30 degrees
/// that are searched to either side of the prediction.
TEST(Resume, predicts_the_turn_that_the_robot_makes_meanwhile) {
  const ResumeDrive& drive = short_drive();
  const auto heading = [&](std::size_t i) {
    return yaw_of(drive.scans[i].odometry.T_frame_child.q);
  };
  constexpr std::size_t kScans = 20;
  std::size_t stop = 10;
  for (std::size_t i = stop; i + 2 * kScans < drive.scans.size(); ++i) {
    if (std::abs(wrap_angle(heading(i + kScans) - heading(i))) >
        std::abs(wrap_angle(heading(stop + kScans) - heading(stop)))) {
      stop = i;
    }
  }
  ASSERT_GT(std::abs(wrap_angle(heading(stop + kScans) - heading(stop))), 0.6);
  const auto& stopped = drive.scans[stop];
  const auto resumed = resume(drive,
                              stopped.checkpoint,
                              drive.points_until(stopped.checkpoint.stamp_ns),
                              stopped.checkpoint.stamp_ns + from_seconds(1.0),
                              6.0);
  ASSERT_TRUE(said(resumed.events, "lio_resumed"));
  ASSERT_FALSE(resumed.scans.empty());
  const Pose* undisturbed = drive.pose_at(resumed.scans.back().odometry.stamp_ns);
  ASSERT_NE(undisturbed, nullptr);
  EXPECT_LT((resumed.scans.back().odometry.T_frame_child.p - undisturbed->p).norm(), kSameTrack_m);
}

/// Half a second of sweeps is less than an ordinary start needs: only who looks where the robot
/// went is found.
TEST(Resume, finds_at_once_who_began_or_ceased_to_turn_meanwhile) {
  const ResumeDrive& drive = short_drive();
  constexpr std::size_t kAway = 10;  // scans: one second
  constexpr double kScan_s = 0.1;
  const auto turned_rad = [&](std::size_t from, std::size_t to) {
    return wrap_angle(yaw_of(drive.scans[to].odometry.T_frame_child.q) -
                      yaw_of(drive.scans[from].odometry.T_frame_child.q));
  };
  /// Between the turn made and the one that the first moment afterwards tells.
  const auto surprise_rad = [&](std::size_t i) {
    const double rate_radps = turned_rad(i + kAway, i + kAway + 2) / (2 * kScan_s);
    return std::abs(rate_radps * kAway * kScan_s - turned_rad(i, i + kAway));
  };
  std::size_t stop = 10;
  for (std::size_t i = stop; i + 2 * kAway < drive.scans.size(); ++i) {
    stop = surprise_rad(i) > surprise_rad(stop) ? i : stop;
  }
  ASSERT_GT(surprise_rad(stop), 0.2);
  const auto& stopped = drive.scans[stop];
  const auto resumed = resume(drive,
                              stopped.checkpoint,
                              drive.points_until(stopped.checkpoint.stamp_ns),
                              stopped.checkpoint.stamp_ns + from_seconds(kAway * kScan_s),
                              0.5);
  ASSERT_TRUE(said(resumed.events, "lio_resumed"));
  ASSERT_FALSE(resumed.scans.empty());
  const Pose* undisturbed = drive.pose_at(resumed.scans.back().odometry.stamp_ns);
  ASSERT_NE(undisturbed, nullptr);
  EXPECT_LT((resumed.scans.back().odometry.T_frame_child.p - undisturbed->p).norm(), kSameTrack_m);
}

TEST(Resume, begins_a_new_epoch_where_the_map_is_of_another_place_and_loses_no_sweep) {
  const ResumeDrive& drive = short_drive();
  const auto& stopped = drive.scans.at(drive.scans.size() / 2);
  lio_mapper::Checkpoint elsewhere = stopped.checkpoint;
  elsewhere.T_odom_base.p.x() += 40.0;  // four times what is searched
  const Nanoseconds from_ns = stopped.checkpoint.stamp_ns + from_seconds(0.7);
  const auto resumed =
      resume(drive, elsewhere, drive.points_until(stopped.checkpoint.stamp_ns), from_ns, 100.0);
  EXPECT_FALSE(said(resumed.events, "lio_resumed"));
  EXPECT_TRUE(said(resumed.events, "lio_not_resumed"));
  std::size_t sweeps = 0;
  for (const auto& entry : drive.entries) {
    sweeps += holds<PointCloudMessage>(entry) && entry.receive_ns > from_ns ? 1 : 0;
  }
  EXPECT_GE(resumed.scans.size() + 1, sweeps);  // the first began before the IMU did
  EXPECT_EQ(resumed.scans.back().status.odom_epoch, stopped.status.odom_epoch + 1);
  EXPECT_EQ(resumed.scans.back().status.reset.counter, stopped.status.reset.counter + 1);
}

TEST(Resume, gives_the_same_bits_twice) {
  const ResumeDrive& drive = short_drive();
  const auto& stopped = drive.scans.at(drive.scans.size() / 2);
  const auto run = [&] {
    return resume(drive,
                  stopped.checkpoint,
                  drive.points_until(stopped.checkpoint.stamp_ns),
                  stopped.checkpoint.stamp_ns,
                  3.0);
  };
  const auto a = run();
  const auto b = run();
  ASSERT_EQ(a.scans.size(), b.scans.size());
  ASSERT_FALSE(a.scans.empty());
  EXPECT_EQ(a.scans.back().odometry.T_frame_child.p, b.scans.back().odometry.T_frame_child.p);
}

Entries entries_between(double from_s, double to_s) {
  const Entries& all = stored_drive().entries;
  const Nanoseconds first_ns = all.front().receive_ns;
  Entries some;
  for (const auto& entry : all) {
    const double t_s = to_seconds(entry.receive_ns - first_ns);
    if (t_s >= from_s && t_s < to_s) {
      some.push_back(entry);
    }
  }
  return some;
}

MapLogResult map_into(const std::string& session,
                      const Entries& entries,
                      UseOfStored use = UseOfStored::kNothing,
                      const std::string& stored = {},
                      Events* events = nullptr) {
  StoredLog log(entries);
  MapLogOptions options;
  options.session = session;
  options.use = use;
  options.on_event = [events](const Event& event) {
    if (events != nullptr) {
      events->push_back(event);
    }
    if (event.code == "lio_not_resumed") {
      ADD_FAILURE() << event.text;
    }
  };
  if (use != UseOfStored::kNothing) {
    options.stored = open_stored_session(stored);
  }
  return map_log(log, stored_drive().configs, options);
}

std::uint64_t keyframes_in(const std::string& session) {
  std::set<std::uint64_t> ids;
  const std::uint64_t count = lio_mapper::read_keyframes(
      session + "/keyframes.sqlite", [&](const auto& keyframe) { ids.insert(keyframe.id); });
  EXPECT_EQ(ids.size(), count) << "ids collide";
  return count;
}

TEST(MapLogResume, appends_to_the_session_and_goes_on_counting) {
  const ScratchFolder folder;
  map_into(folder.path(), entries_between(0.0, 4.0));
  const auto before = open_stored_session(folder.path());
  const std::uint64_t keyframes = keyframes_in(folder.path());
  const std::size_t poses = exporter::read_trajectory(folder.file("lio.tum")).size();
  map_into(folder.path(), entries_between(4.5, 7.0), UseOfStored::kResume, folder.path());
  const auto after = open_stored_session(folder.path());
  EXPECT_EQ(after.checkpoint.odom_epoch, before.checkpoint.odom_epoch);
  EXPECT_GT(after.checkpoint.scans_used, before.checkpoint.scans_used);
  EXPECT_GT(after.checkpoint.stamp_ns, before.checkpoint.stamp_ns);
  EXPECT_GT(keyframes_in(folder.path()), keyframes);
  EXPECT_GT(exporter::read_trajectory(folder.file("lio.tum")).size(), poses + 15);

  const std::vector<exporter::RunInfo> runs = exporter::runs_in(folder.path());
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[0].log, "stored");
  EXPECT_LT(runs[0].end_ns.value(), runs[1].begin_ns.value());
  EXPECT_NEAR(to_seconds(*runs[1].begin_ns - runs[0].begin_ns.value()), 4.5, 0.02);
  EXPECT_EQ(exporter::read_sweeps(folder.file("sweeps.csv")).size(),
            exporter::read_trajectory(folder.file("lio.tum")).size());
}

/// A power failure leaves files of no bytes.
TEST(MapLogResume, goes_on_from_damaged_files_and_says_which) {
  const ScratchFolder folder;
  map_into(folder.path(), entries_between(0.0, 4.0));
  test::write_all(folder.file("alignment.yaml"), "");
  test::write_all(folder.file("datum.yaml"), "");  // not of the mapper, which must start
  for (const std::string program : {"fusion_gate", "gps_odometry", "log"}) {
    test::write_all(folder.file(program + ".counts.yaml"), "fix: [\n");
  }
  Events events;
  map_into(folder.path(), entries_between(4.5, 7.0), UseOfStored::kResume, folder.path(), &events);
  std::string warned;
  for (const Event& event : events) {
    warned += event.code == "session_file_damaged" ? event.text + "\n" : "";
  }
  for (const char* file : {"alignment.yaml",
                           "fusion_gate.counts.yaml",
                           "gps_odometry.counts.yaml",
                           "log.counts.yaml"}) {
    EXPECT_NE(warned.find(file), std::string::npos) << file << " is not in:\n" << warned;
  }
}

PlaceTrial try_later_entries(const StoredSession& stored, double to_s = 7.0) {
  const Entries entries = entries_between(4.5, to_s);
  StoredLog log(entries);
  CoreConfigs configs = stored_drive().configs;
  configs.lio_mapper.recovery.attempts = 1;
  return try_place(log, configs, stored);
}

TEST(PlaceTrial, finds_what_a_resumed_session_finds_and_writes_nothing) {
  const ScratchFolder folder;
  map_into(folder.path(), entries_between(0.0, 4.0));
  const std::string before = test::read_all(folder.file("keyframes.sqlite"));
  EXPECT_EQ(try_later_entries(open_stored_session(folder.path())).verdict,
            PlaceTrial::Verdict::kFound);
  EXPECT_TRUE(before == test::read_all(folder.file("keyframes.sqlite")));
}

TEST(PlaceTrial, says_why_the_place_was_not_found) {
  const ScratchFolder folder;
  map_into(folder.path(), entries_between(0.0, 4.0));
  StoredSession elsewhere = open_stored_session(folder.path());
  elsewhere.first_pose.reset();
  elsewhere.checkpoint.T_odom_base.p.x() += 40.0;  // four times what is searched
  const PlaceTrial trial = try_later_entries(elsewhere);
  EXPECT_EQ(trial.verdict, PlaceTrial::Verdict::kNotFound);
  EXPECT_FALSE(trial.why_not.empty());
  EXPECT_EQ(trial.why_not.find("epoch"), std::string::npos) << trial.why_not;
  const PlaceTrial too_short = try_later_entries(open_stored_session(folder.path()), 4.6);
  EXPECT_EQ(too_short.verdict, PlaceTrial::Verdict::kNotFound);
  EXPECT_EQ(too_short.why_not, "the log ended before the search for the place did");
}

TEST(PlaceTrial, ends_when_it_is_asked_to) {
  const ScratchFolder folder;
  map_into(folder.path(), entries_between(0.0, 4.0));
  StoredLog log(stored_drive().entries);
  EXPECT_EQ(
      try_place(
          log, stored_drive().configs, open_stored_session(folder.path()), [] { return true; })
          .verdict,
      PlaceTrial::Verdict::kStopped);
}

TEST(MapLogLocalize, leaves_the_stored_session_as_it_is) {
  const ScratchFolder stored;
  const ScratchFolder result;
  map_into(stored.path(), entries_between(0.0, 5.0));
  const std::string before = test::read_all(stored.file("keyframes.sqlite"));
  const auto localized =
      map_into(result.path(), entries_between(0.0, 5.0), UseOfStored::kLocalize, stored.path());
  EXPECT_GT(localized.sweeps_used, 30U);
  EXPECT_TRUE(before == test::read_all(stored.file("keyframes.sqlite")));
  EXPECT_FALSE(std::filesystem::exists(result.file("keyframes.sqlite")));
  const auto mapped = exporter::read_trajectory(stored.file("lio.tum"));
  const auto again = exporter::read_trajectory(result.file("lio.tum"));
  ASSERT_FALSE(again.empty());
  EXPECT_LT((again.back().pose.p - mapped.back().pose.p).norm(), kSameTrack_m);
}

TEST(MapLogResume, refuses_a_folder_without_a_store) {
  const ScratchFolder folder;
  EXPECT_THROW(open_stored_session(folder.path()), ConfigError);
}

}  // namespace
}  // namespace trigpoint::pipeline
