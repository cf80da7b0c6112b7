// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/map_log.hpp"

#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "stored_log.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <iterator>
#include <stdexcept>

namespace trigpoint::pipeline {
namespace {

using test::read_all;
using test::ScratchFolder;

MapLogResult run(const std::string& session, recording::LogReader& log) {
  MapLogOptions options;
  options.session = session;
  options.config_text = "robot: {}\n";
  options.mode = "hard";
  return map_log(log, stored_drive().configs, options);
}

MapLogResult run(const std::string& session, const Entries& entries) {
  StoredLog log(entries);
  return run(session, log);
}

std::uint64_t count_of(const ScratchFolder& folder,
                       const std::string& part,
                       const std::string& name) {
  for (const NamedCount& count : exporter::read_counts(folder.file(part + ".counts.yaml"))) {
    if (count.name == name) {
      return count.count;
    }
  }
  ADD_FAILURE() << part << " counts no " << name;
  return 0;
}

TEST(MapLog, leaves_the_same_bytes_twice) {
  const ScratchFolder a;
  const ScratchFolder b;
  run(a.path(), stored_drive().entries);
  run(b.path(), stored_drive().entries);
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(a.path())) {
    const std::string name = entry.path().filename();
    // Both tell how long the computer took.
    if (entry.is_regular_file() && name != "run.yaml" && name != "scans.csv") {
      ++files;
      const std::string bytes = read_all(a.file(name));
      EXPECT_FALSE(bytes.empty()) << name;
      EXPECT_TRUE(bytes == read_all(b.file(name))) << name;
    }
  }
  EXPECT_GE(files, 12U);
}

TEST(MapLog, finds_the_same_bits_with_reading_and_writing_beside_as_the_cores_in_lock_step) {
  Lockstep cores(stored_drive().configs);
  std::vector<lio_mapper::ScanResult> scans;
  std::vector<Odometry> fused;
  const auto take = [&](Step step) {
    std::move(step.scans.begin(), step.scans.end(), std::back_inserter(scans));
    std::move(step.fused.begin(), step.fused.end(), std::back_inserter(fused));
  };
  for (const recording::LogEntry& entry : stored_drive().entries) {
    take(cores.step(entry));
  }
  take(cores.finish());
  const ScratchFolder folder;
  run(folder.path(), stored_drive().entries);
  std::vector<lio_mapper::Keyframe> stored;
  lio_mapper::read_keyframes(folder.file("keyframes.sqlite"),
                             [&](const auto& keyframe) { stored.push_back(keyframe); });
  std::size_t next = 0;
  for (const lio_mapper::ScanResult& scan : scans) {
    if (scan.keyframe) {
      ASSERT_LT(next, stored.size());
      EXPECT_EQ(stored[next].id, scan.keyframe->id);
      EXPECT_EQ(stored[next].T_odom_base.p, scan.keyframe->T_odom_base.p);
      EXPECT_EQ(stored[next].pose_covariance, scan.keyframe->pose_covariance);
      ++next;
    }
  }
  EXPECT_EQ(next, stored.size());
  EXPECT_GT(next, 5U);
  const auto checkpoint = stored_checkpoint(folder.path());
  ASSERT_TRUE(checkpoint.has_value());
  EXPECT_EQ(checkpoint->T_odom_base.p, scans.back().odometry.T_frame_child.p);
  EXPECT_EQ(checkpoint->covariance, cores.checkpoint()->covariance);
  EXPECT_EQ(exporter::read_trajectory(folder.file("lio.tum")).size(), scans.size());
  EXPECT_EQ(exporter::read_trajectory(folder.file("fused.tum")).size(), fused.size());
}

TEST(MapLog, tells_what_the_disk_refused_while_the_cores_went_on) {
  const ScratchFolder folder;
  const std::string store = folder.file("keyframes.sqlite");
  { const lio_mapper::KeyframeWriter writer(store); }
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(store.c_str(), &database), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(database,
                         "CREATE TRIGGER full BEFORE INSERT ON keyframes WHEN NEW.id = 2 "
                         "BEGIN SELECT RAISE(FAIL, 'no space left'); END",
                         nullptr,
                         nullptr,
                         nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  try {
    run(folder.path(), stored_drive().entries);
    FAIL() << "the failure was kept secret";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("no space left"));
  }
  EXPECT_EQ(lio_mapper::read_keyframes(store, [](const auto&) {}), 2U);
}

TEST(MapLog, accounts_for_every_message_of_the_log) {
  Entries entries = stored_drive().entries;
  std::uint64_t withheld = 0;
  for (recording::LogEntry& entry : entries) {
    entry.withheld = holds<GnssFix>(entry) && (++withheld % 3 == 0);
  }
  const std::uint64_t fixes = count<GnssFix>(entries);
  withheld = fixes / 3;
  ASSERT_GT(withheld, 0U);
  const ScratchFolder folder;
  const MapLogResult result = run(folder.path(), entries);
  const std::uint64_t sweeps = count<PointCloudMessage>(entries);
  const std::uint64_t imu = count<ImuSample>(entries);
  EXPECT_EQ(result.sweeps_in_log, sweeps);
  EXPECT_EQ(result.sweeps_used, sweeps);
  EXPECT_EQ(count_of(folder, "log", "points.in_log"), sweeps);
  EXPECT_EQ(count_of(folder, "log", "imu.in_log"), imu);
  EXPECT_EQ(count_of(folder, "log", "fix.in_log"), fixes);
  EXPECT_EQ(count_of(folder, "log", "fix.withheld"), withheld);
  EXPECT_EQ(count_of(folder, "log", "fix.published"), fixes - withheld);
  EXPECT_EQ(count_of(folder, "lio_mapper", "points.received"), sweeps);
  EXPECT_EQ(count_of(folder, "lio_mapper", "points.used"), sweeps);
  EXPECT_EQ(count_of(folder, "lio_mapper", "imu.received"), imu);
  EXPECT_EQ(count_of(folder, "gps_odometry", "imu.received"), imu);
  EXPECT_EQ(count_of(folder, "gps_odometry", "fix.received"), fixes - withheld);
  EXPECT_EQ(exporter::read_fixes(folder.file("fixes.csv")).size(), fixes);
  EXPECT_EQ(exporter::read_trajectory(folder.file("lio.tum")).size(), sweeps);
  EXPECT_EQ(exporter::read_scans(folder.file("scans.csv")).size(), sweeps);
}

TEST(MapLog, keeps_what_came_before_a_log_breaks_off_and_says_why) {
  const ScratchFolder folder;
  StoredLog log(stored_drive().entries, stored_drive().entries.size() / 2);
  const MapLogResult result = run(folder.path(), log);
  EXPECT_EQ(result.log_error, "stored: torn off");
  EXPECT_FALSE(result.stopped);
  EXPECT_GT(result.sweeps_used, 10U);
  EXPECT_EQ(exporter::read_trajectory(folder.file("lio.tum")).size(), result.sweeps_used);
  EXPECT_EQ(count_of(folder, "log", "points.in_log"), result.sweeps_in_log);
}

TEST(MapLog, ends_early_when_it_is_asked_to_and_keeps_what_was_done) {
  const ScratchFolder folder;
  StoredLog log(stored_drive().entries);
  MapLogOptions options;
  options.session = folder.path();
  std::size_t asked = 0;
  options.stop = [&] { return ++asked == 1000; };
  const MapLogResult result = map_log(log, stored_drive().configs, options);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(asked, 1000U);
  EXPECT_LT(result.sweeps_in_log, count<PointCloudMessage>(stored_drive().entries));
  EXPECT_EQ(exporter::read_trajectory(folder.file("lio.tum")).size(), result.sweeps_used);
}

TEST(MapLog, tells_its_progress_and_the_cores_events) {
  const ScratchFolder folder;
  StoredLog log(stored_drive().entries);
  MapLogOptions options;
  options.session = folder.path();
  std::vector<double> shares;
  std::vector<std::string> codes;
  options.progress = [&](double share) { shares.push_back(share); };
  options.on_event = [&](const Event& event) { codes.push_back(event.code); };
  map_log(log, stored_drive().configs, options);
  EXPECT_EQ(shares.size(), stored_drive().entries.size());
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.back(), 1.0);
  EXPECT_THAT(codes, testing::Contains("lio_started"));
  EXPECT_THAT(codes, testing::Contains("alignment_admitted"));
}

TEST(MapLog, names_the_session_that_it_cannot_write) {
  StoredLog log(stored_drive().entries);
  EXPECT_THAT(test::error_of([&] { run("/proc/none", log); }), testing::HasSubstr("/proc/none"));
}

/// Looks at the session while the run still goes on, as after kill -9.
class WatchedRun {
 public:
  explicit WatchedRun(const ScratchFolder& folder) {
    StoredLog log(stored_drive().entries);
    MapLogOptions options;
    options.session = folder.path();
    options.mode = "hard";
    options.on_event = [&](const Event& event) {
      admitted_ = admitted_ || event.code == "alignment_admitted";
    };
    options.stop = [&] {
      had_run = had_run || std::filesystem::exists(folder.file("run.yaml"));
      had_datum = had_datum || std::filesystem::exists(folder.file("datum.yaml"));
      if (admitted_ && !had_admitted && std::filesystem::exists(folder.file("alignment.yaml"))) {
        had_admitted = exporter::read_alignment(folder.file("alignment.yaml")).admitted;
      }
      return false;
    };
    map_log(log, stored_drive().configs, options);
  }

  bool had_run{false};
  bool had_datum{false};
  bool had_admitted{false};

 private:
  bool admitted_{false};
};

TEST(MapLog, has_written_the_georeference_before_its_end) {
  const ScratchFolder folder;
  const WatchedRun watched(folder);
  EXPECT_TRUE(watched.had_run);
  EXPECT_TRUE(watched.had_datum);
  EXPECT_TRUE(watched.had_admitted);
}

TEST(MapLog, gives_every_fix_one_verdict) {
  const ScratchFolder folder;
  run(folder.path(), stored_drive().entries);
  std::uint64_t verdicts = 0;
  for (const NamedCount& count : exporter::read_counts(folder.file("fusion_gate.counts.yaml"))) {
    verdicts += count.name.starts_with("fix.verdict.") ? count.count : 0;
  }
  EXPECT_EQ(verdicts, count<GnssFix>(stored_drive().entries));
  EXPECT_EQ(verdicts, count_of(folder, "fusion_gate", "fix.judged"));
}

TEST(MapLog, notes_that_it_was_interrupted) {
  const ScratchFolder folder;
  StoredLog log(stored_drive().entries);
  MapLogOptions options;
  options.session = folder.path();
  std::size_t asked = 0;
  options.stop = [&] { return ++asked == 100; };
  map_log(log, stored_drive().configs, options);
  EXPECT_TRUE(exporter::read_run(folder.file("run.yaml")).interrupted);
  run(folder.path(), stored_drive().entries);
  EXPECT_FALSE(exporter::read_run(folder.file("run.yaml")).interrupted);
}

}  // namespace
}  // namespace trigpoint::pipeline
