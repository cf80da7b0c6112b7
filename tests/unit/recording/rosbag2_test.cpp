// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "samples.hpp"
#include "small_disk.hpp"
#include "temporary_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <yaml-cpp/yaml.h>

#include <fstream>
#include <sstream>

namespace trigpoint::recording {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A second of a drive: 100 IMU samples, 10 fixes and clouds, which arrive 50 ms late.
void write_bag_drive(Rosbag2Writer& writer, int seconds = 1) {
  for (int i = 0; i < 100 * seconds; ++i) {
    const auto imu = sample_imu(i);
    writer.write("imu/data", imu.stamp_ns, imu);
    if (i % 10 == 5) {
      const auto fix = sample_fix(i / 10);
      writer.write("gps/fix", fix.stamp_ns + 50 * kMillisecond_ns, fix);
      const auto cloud = sample_cloud(i / 10);
      writer.write("/points", cloud.stamp_ns + 50 * kMillisecond_ns, cloud);
    }
  }
}

fs::path only_db3(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".db3") {
      return entry.path();
    }
  }
  return {};
}

/// The first column of every row, asked of SQLite itself.
std::vector<std::string> query(const fs::path& file, const std::string& sql) {
  sqlite3* database = nullptr;
  EXPECT_EQ(SQLITE_OK, sqlite3_open(file.c_str(), &database));
  std::vector<std::string> values;
  const auto collect = [](void* out, int, char** columns, char**) {
    static_cast<std::vector<std::string>*>(out)->push_back(columns[0] == nullptr ? "NULL"
                                                                                 : columns[0]);
    return 0;
  };
  EXPECT_EQ(SQLITE_OK, sqlite3_exec(database, sql.c_str(), collect, &values, nullptr)) << sql;
  sqlite3_close(database);
  return values;
}

TEST(Rosbag2, reads_back_what_was_written) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string());
    write_bag_drive(writer);
    writer.close();
    EXPECT_EQ(120U, writer.messages_written());
  }
  const auto log = open_log((folder / "log").string(), RobotConfig{});
  EXPECT_EQ("rosbag2", log->summary().format);
  const auto entries = read_all(*log);
  const auto imu = only<ImuSample>(entries);
  ASSERT_EQ(100U, imu.size());
  EXPECT_EQ(sample_imu(42).stamp_ns, imu[42].stamp_ns);
  EXPECT_EQ("imu_link", imu[42].frame_id);
  EXPECT_EQ(sample_imu(42).gyro_radps, imu[42].gyro_radps);
  EXPECT_EQ(sample_imu(42).accel_mps2, imu[42].accel_mps2);
  ASSERT_TRUE(imu[42].q_world_base);
  EXPECT_TRUE(imu[42].q_world_base->isApprox(*sample_imu(42).q_world_base));

  const auto fixes = only<GnssFix>(entries);
  ASSERT_EQ(10U, fixes.size());
  EXPECT_EQ(sample_fix(3).latitude_deg, fixes[3].latitude_deg);
  EXPECT_EQ(sample_fix(3).covariance_enu_m2, fixes[3].covariance_enu_m2);
  EXPECT_EQ(FixStatus::kGbas, fixes[3].status);
  EXPECT_EQ(CovarianceType::kKnown, fixes[3].covariance_type);

  const auto clouds = only<PointCloudMessage>(entries);
  ASSERT_EQ(10U, clouds.size());
  EXPECT_EQ(sample_cloud(7).data, clouds[7].data);
  ASSERT_EQ(4U, clouds[7].fields.size());
  EXPECT_EQ("time", clouds[7].fields[3].name);
  EXPECT_EQ(12U, clouds[7].fields[3].offset);
}

TEST(Rosbag2, delivers_in_order_of_arrival_however_it_was_written) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string());
    write_bag_drive(writer);
    writer.write("imu/data", kStart_ns - kMillisecond_ns, sample_imu(-1));
  }
  const auto entries = read_all(*open_log((folder / "log").string(), RobotConfig{}));
  EXPECT_EQ(kStart_ns - kMillisecond_ns, entries.front().receive_ns);
  EXPECT_TRUE(
      std::is_sorted(entries.begin(), entries.end(), [](const LogEntry& a, const LogEntry& b) {
        return a.receive_ns < b.receive_ns;
      }));
}

TEST(Rosbag2, has_the_tables_of_ros_2_humble) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string());
    writer.declare_topic("datum", "sensor_msgs/msg/NavSatFix", Durability::kTransientLocal);
    write_bag_drive(writer);
  }
  const auto file = folder / "log" / "log_0.db3";
  EXPECT_THAT(
      query(file, "SELECT name FROM sqlite_master WHERE type IN ('table','index') ORDER BY name"),
      testing::ElementsAre("messages", "metadata", "schema", "timestamp_idx", "topics"));
  EXPECT_THAT(query(file, "SELECT name FROM pragma_table_info('messages')"),
              testing::ElementsAre("id", "topic_id", "timestamp", "data"));
  EXPECT_THAT(
      query(file, "SELECT name FROM pragma_table_info('topics')"),
      testing::ElementsAre("id", "name", "type", "serialization_format", "offered_qos_profiles"));
  EXPECT_THAT(
      query(file,
            "SELECT name || ' ' || type || ' ' || serialization_format FROM topics ORDER BY name"),
      testing::ElementsAre("/datum sensor_msgs/msg/NavSatFix cdr",
                           "/gps/fix sensor_msgs/msg/NavSatFix cdr",
                           "/imu/data sensor_msgs/msg/Imu cdr",
                           "/points sensor_msgs/msg/PointCloud2 cdr"));
  EXPECT_THAT(query(file, "SELECT schema_version FROM schema"), testing::ElementsAre("3"));
  // Encapsulation header: CDR, little-endian.
  EXPECT_THAT(query(file, "SELECT DISTINCT hex(substr(data, 1, 2)) FROM messages"),
              testing::ElementsAre("0001"));
  EXPECT_THAT(query(file, "PRAGMA integrity_check"), testing::ElementsAre("ok"));
  EXPECT_THAT(query(file, "PRAGMA journal_mode"), testing::ElementsAre("delete"))
      << "a WAL file does not open on a read-only disk";
}

TEST(Rosbag2, metadata_says_what_ros2_bag_asks_for) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string());
    writer.declare_topic("datum", "sensor_msgs/msg/NavSatFix", Durability::kTransientLocal);
    write_bag_drive(writer);
  }
  const auto info =
      YAML::LoadFile((folder / "log" / "metadata.yaml").string())["rosbag2_bagfile_information"];
  EXPECT_EQ(5, info["version"].as<int>());
  EXPECT_EQ("sqlite3", info["storage_identifier"].as<std::string>());
  EXPECT_EQ(kStart_ns, info["starting_time"]["nanoseconds_since_epoch"].as<Nanoseconds>());
  EXPECT_EQ(990 * kMillisecond_ns, info["duration"]["nanoseconds"].as<Nanoseconds>());
  EXPECT_EQ(120U, info["message_count"].as<unsigned>());
  EXPECT_EQ("log_0.db3", info["relative_file_paths"][0].as<std::string>());
  EXPECT_EQ("log_0.db3", info["files"][0]["path"].as<std::string>());
  EXPECT_EQ("", info["compression_format"].as<std::string>());
  ASSERT_EQ(4U, info["topics_with_message_count"].size());
  const auto datum = info["topics_with_message_count"][0];
  EXPECT_EQ("/datum", datum["topic_metadata"]["name"].as<std::string>());
  EXPECT_EQ(0U, datum["message_count"].as<unsigned>());
  // rosbag2 parses this text as YAML again.
  const auto qos = YAML::Load(datum["topic_metadata"]["offered_qos_profiles"].as<std::string>());
  EXPECT_EQ(1, qos[0]["durability"].as<int>()) << "transient local";
  EXPECT_EQ(1, qos[0]["reliability"].as<int>());
  EXPECT_EQ(9223372036, qos[0]["deadline"]["sec"].as<std::int64_t>());
}

TEST(Rosbag2, a_killed_recorder_leaves_a_readable_bag) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Rosbag2Writer writer(path);
    write_bag_drive(writer);
    writer.flush();
    writer.write(
        "imu/data", kStart_ns + kNanosecondsPerSecond, sample_imu(100));  // not durable yet
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(fs::exists(folder / "log" / "metadata.yaml"));
  EXPECT_EQ(120U, read_all(*open_log(path, RobotConfig{})).size());
}

TEST(Rosbag2, a_full_disk_is_told_and_keeps_what_was_written) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  constexpr std::uint64_t kLimit_bytes = 300'000;
  Rosbag2Writer writer(path, Storage::kSqlite3, kLimit_bytes);
  const auto told = message_of<LogError>([&] {
    for (int i = 0; i < 1000; ++i) {
      writer.write("points", kStart_ns + i * 100 * kMillisecond_ns, sample_cloud(i, 1000));
      writer.flush();
    }
  });
  EXPECT_THAT(told, HasSubstr("full"));
  EXPECT_THAT(told, HasSubstr("log_0.db3"));
  const auto kept = writer.messages_written();
  EXPECT_GT(kept, 5U);
  EXPECT_THAT(told, HasSubstr(std::to_string(kept) + " messages"));
  EXPECT_THROW(writer.write("points", kStart_ns, sample_cloud(0)), LogError);

  LogOptions points_alone;
  points_alone.require_imu = false;
  points_alone.require_fix = false;
  const auto entries = read_all(*open_log(path, RobotConfig{}, points_alone));
  ASSERT_EQ(kept, entries.size());
  EXPECT_EQ(sample_cloud(3, 1000).data, std::get<PointCloudMessage>(entries[3].measurement).data);
}

TEST(Rosbag2, a_full_disk_within_a_transaction_counts_only_what_is_durable) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  Rosbag2Writer writer(path, Storage::kSqlite3, 300'000);
  EXPECT_THROW(
      {
        for (int i = 0; i < 1000; ++i) {
          writer.write("points", kStart_ns + i * 100 * kMillisecond_ns, sample_cloud(i, 1000));
        }
      },
      LogError);
  const auto durable = query(only_db3(folder / "log"), "SELECT count(*) FROM messages");
  EXPECT_EQ(std::to_string(writer.messages_written()), durable.at(0));
}

TEST(Rosbag2, a_truncated_file_delivers_what_came_before_then_says_so) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  {
    Rosbag2Writer writer(path);
    for (int i = 0; i < 200; ++i) {
      writer.write("imu/data", sample_imu(i).stamp_ns, sample_imu(i));
      writer.write("points", sample_imu(i).stamp_ns, sample_cloud(i));
      writer.write("gps/fix", sample_imu(i).stamp_ns, sample_fix(i));
    }
  }
  const auto file = only_db3(path);
  const auto size = fs::file_size(file);
  fs::resize_file(file, size / 2);
  const auto log = open_log(path, RobotConfig{});
  std::vector<LogEntry> entries;
  const auto told = message_of<LogError>([&] {
    while (auto entry = log->next()) {
      entries.push_back(*entry);
    }
  });
  EXPECT_THAT(told, HasSubstr("breaks off"));
  EXPECT_THAT(told, HasSubstr("log_0.db3"));
  EXPECT_GT(entries.size(), 150U);
  EXPECT_LT(entries.size(), 600U);
  EXPECT_EQ(sample_imu(20).gyro_radps, only<ImuSample>(entries).at(20).gyro_radps);
}

TEST(Rosbag2, damaged_messages_are_skipped_told_once_and_counted) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  {
    Rosbag2Writer writer(path);
    const std::vector<std::uint8_t> rubbish{0, 1, 0, 0, 9};
    for (int i = 0; i < 3; ++i) {
      writer.write_cdr(
          "imu/data", "sensor_msgs/msg/Imu", kStart_ns + (2 + i) * kMillisecond_ns, rubbish);
    }
    writer.write_cdr("points", "sensor_msgs/msg/PointCloud2", kStart_ns, rubbish);
    write_bag_drive(writer);
  }
  const auto log = open_log(path, RobotConfig{});
  EXPECT_EQ(120U, read_all(*log).size()) << "the log goes on";
  const Events events = log->take_events();
  ASSERT_EQ(2U, events.size()) << "once a topic";
  EXPECT_THAT(events[0].text,
              testing::AllOf(HasSubstr("message 1 of '/points'"), HasSubstr("5 bytes")));
  EXPECT_THAT(events[1].text, HasSubstr("message 2 of '/imu/data'"));
  EXPECT_TRUE(log->take_events().empty());
  const auto counts = log->undecodable();
  ASSERT_EQ(2U, counts.size());
  EXPECT_EQ("imu", counts[1].input);
  EXPECT_EQ(3U, counts[1].count);
  EXPECT_THAT(undecodable_events(*log)[1].text, HasSubstr("3 messages of '/imu/data'"));
}

TEST(Rosbag2, is_salvaged_where_sqlite_cannot_walk_it_with_sqlite_s_own_words) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  {
    Rosbag2Writer writer(path);
    // Large enough for a page between root and leaves, which lies late in the file.
    for (int i = 0; i < 4000; ++i) {
      writer.write("imu/data", sample_imu(i).stamp_ns, sample_imu(i));
      if (i % 10 == 0) {
        writer.write("points", sample_imu(i).stamp_ns, sample_cloud(i, 1000));
        writer.write("gps/fix", sample_imu(i).stamp_ns, sample_fix(i));
      }
    }
  }
  const auto file = only_db3(path);
  fs::resize_file(file, fs::file_size(file) / 2);
  const auto log = open_log(path, RobotConfig{});
  ASSERT_EQ(1U, log->summary().faults.size());
  EXPECT_THAT(log->summary().faults[0],
              testing::AllOf(HasSubstr("log_0.db3"), HasSubstr("malformed")));
  std::vector<LogEntry> entries;
  const auto told = message_of<LogError>([&] {
    while (auto entry = log->next()) {
      entries.push_back(*entry);
    }
  });
  EXPECT_THAT(told, testing::AllOf(HasSubstr("malformed"), HasSubstr("breaks off")));
  const auto imu = only<ImuSample>(entries);
  ASSERT_GT(imu.size(), 1000U);
  for (std::size_t i = 0; i < 1000; ++i) {
    ASSERT_EQ(sample_imu(static_cast<int>(i)).gyro_radps, imu[i].gyro_radps);
  }
  const auto clouds = only<PointCloudMessage>(entries);
  ASSERT_GT(clouds.size(), 100U);
  EXPECT_EQ(sample_cloud(990, 1000).data, clouds[99].data) << "over several pages";
}

TEST(Rosbag2, a_folder_without_metadata_is_a_fault) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  {
    Rosbag2Writer writer(path);
    write_bag_drive(writer);
  }
  EXPECT_TRUE(open_log(path, RobotConfig{})->summary().faults.empty());
  fs::remove(folder / "log" / "metadata.yaml");
  const auto log = open_log(path, RobotConfig{});
  EXPECT_THAT(log->summary().faults, testing::ElementsAre(HasSubstr("no metadata.yaml")));
  EXPECT_EQ(120U, read_all(*log).size());
}

TEST(Rosbag2, empties_its_write_ahead_log_while_it_writes) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  constexpr std::uint32_t kPoints = 20'000;
  constexpr int kClouds = 100;
  Rosbag2Writer writer(path);
  const auto cloud = sample_cloud(0, kPoints);
  for (int i = 0; i < kClouds; ++i) {
    writer.write("points", kStart_ns + i * kMillisecond_ns, cloud);
  }
  const auto written = kClouds * cloud.data.size();
  EXPECT_LT(fs::file_size(folder / "log" / "log_0.db3-wal"), written / 2);
  EXPECT_GT(fs::file_size(folder / "log" / "log_0.db3"), written / 2);
}

/// A limit on the size of each file is worse than a full disk: no room that is given back helps the
/// database, so that its last messages stay in the write-ahead log. With TMPDIR on a small tmpfs it
/// is the disk that is full.
TEST(Rosbag2, on_a_disk_that_takes_no_more_what_was_written_before_is_readable_and_counted) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  std::string told;
  {
    const tests::SmallDisk disk(20U << 20U);
    told = message_of<LogError>([&] {
      Rosbag2Writer writer(path);
      for (int i = 0; i < 1000; ++i) {
        writer.write("points", kStart_ns + i * kMillisecond_ns, sample_cloud(i % 50, 5000));
      }
    });
  }
  LogOptions points_alone;
  points_alone.require_imu = false;
  points_alone.require_fix = false;
  const auto log = open_log(path, RobotConfig{}, points_alone);
  const auto kept = read_all(*log).size();
  EXPECT_GT(kept, 100U);
  EXPECT_THAT(told, HasSubstr("with " + std::to_string(kept) + " messages"));
}

TEST(Rosbag2, never_writes_over_another_recording) {
  TemporaryFolder folder;
  std::ofstream(folder / "something").put('x');
  EXPECT_THAT(message_of<LogError>([&] { Rosbag2Writer writer(folder.path().string()); }),
              HasSubstr("not empty"));
}

TEST(Rosbag2, reads_a_bag_of_several_files_in_their_order) {
  TemporaryFolder folder;
  for (int part = 0; part < 11; ++part) {
    const auto one = folder / ("part" + std::to_string(part));
    Rosbag2Writer writer(one.string());
    writer.write("imu/data", sample_imu(part).stamp_ns, sample_imu(part));
    writer.close();
    fs::create_directories(folder / "split");
    fs::copy_file(only_db3(one), folder / "split" / ("drive_" + std::to_string(part) + ".db3"));
  }
  LogOptions imu_alone;
  imu_alone.require_points = false;
  imu_alone.require_fix = false;
  const auto entries = read_all(*open_log((folder / "split").string(), RobotConfig{}, imu_alone));
  ASSERT_EQ(11U, entries.size());
  EXPECT_EQ(sample_imu(10).stamp_ns, entries[10].receive_ns);
}

TEST(Rosbag2, names_what_it_cannot_read) {
  TemporaryFolder folder;
  std::ofstream(folder / "metadata.yaml")
      << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: tape\n  "
         "relative_file_paths: [a.tape]\n";
  EXPECT_THAT(message_of<LogError>([&] { open_log(folder.path().string(), RobotConfig{}); }),
              HasSubstr("storage 'tape'"));
  std::ofstream(folder / "text.db3")
      << "this is no database at all, but long enough to look like a file";
  EXPECT_THAT(
      message_of<LogError>([&] { open_log((folder / "text.db3").string(), RobotConfig{}); }),
      HasSubstr("text.db3"));
}

}  // namespace
}  // namespace trigpoint::recording
