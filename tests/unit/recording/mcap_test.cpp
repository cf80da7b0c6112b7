// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP files of our own making. Those of another house: mcap_npm_test.cpp; damaged ones:
// mcap_damage_test.cpp.
#include "mcap_drive.hpp"
#include "mcap_file.hpp"
#include "mcap_format.hpp"
#include "small_disk.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <numeric>

namespace trigpoint::recording {
namespace {

namespace fs = std::filesystem;
using mcap::RecordWriter;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

LogOptions only_imu() {
  LogOptions options;
  options.require_points = false;
  options.require_fix = false;
  return options;
}

TEST(Mcap, a_folder_and_a_single_file_are_read_back_as_they_were_written) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string(), Storage::kMcap);
    write_drive(writer, 11);
    writer.close();
    EXPECT_EQ(120U, writer.messages_written());
    Rosbag2Writer single((folder / "new" / "single.mcap").string());
    write_drive(single);
  }
  for (const auto& path :
       {folder / "log", folder / "log" / "log_0.mcap", folder / "new" / "single.mcap"}) {
    const Heard heard = hear(path);
    EXPECT_TRUE(heard.entries == drive_in_order()) << path;
    EXPECT_FALSE(heard.complains()) << path << heard.error;
  }
  EXPECT_EQ("rosbag2", open_log((folder / "log").string(), RobotConfig{})->summary().format);
  const auto single = open_log((folder / "new" / "single.mcap").string(), RobotConfig{});
  EXPECT_EQ("mcap", single->summary().format);
  EXPECT_EQ(kStart_ns, single->summary().first_ns);
  EXPECT_EQ(sample_imu(99).stamp_ns, single->summary().last_ns);
  ASSERT_EQ(3U, single->summary().topics.size());
  EXPECT_EQ("/imu/data", single->summary().topics[1].topic);
  EXPECT_EQ("sensor_msgs/msg/Imu", single->summary().topics[1].type);
  EXPECT_EQ(100U, single->summary().topics[1].messages);
  EXPECT_FALSE(fs::exists(folder / "new" / "metadata.yaml"));
  EXPECT_EQ(1, std::distance(fs::directory_iterator(folder / "new"), fs::directory_iterator()))
      << "nothing else is left";
}

TEST(Mcap, metadata_says_what_ros2_bag_asks_for) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string(), Storage::kMcap);
    write_drive(writer);
  }
  const auto info =
      YAML::LoadFile((folder / "log" / "metadata.yaml").string())["rosbag2_bagfile_information"];
  EXPECT_EQ("mcap", info["storage_identifier"].as<std::string>());
  EXPECT_EQ("log_0.mcap", info["relative_file_paths"][0].as<std::string>());
  EXPECT_EQ(120U, info["message_count"].as<unsigned>());
}

TEST(Mcap, delivers_in_order_of_arrival_however_it_was_written) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "log").string(), Storage::kMcap);
    write_drive(writer, 10);
    writer.write("imu/data", kStart_ns - kMillisecond_ns, sample_imu(-1));
  }
  const Heard heard = hear(folder / "log");
  EXPECT_EQ(121U, heard.entries.size());
  EXPECT_TRUE(is_in_order_of_arrival(heard.entries));
  EXPECT_EQ(text_of({kStart_ns - kMillisecond_ns, sample_imu(-1), false}), heard.entries.front());
}

TEST(Mcap, several_files_of_a_bag_are_one_log_in_order_also_where_they_overlap) {
  TemporaryFolder folder;
  const auto bag = folder / "drive";
  fs::create_directories(bag);
  for (int part = 0; part < 11; ++part) {
    Rosbag2Writer writer((bag / ("drive_" + std::to_string(part) + ".mcap")).string());
    for (int i = 0; i < 10; ++i) {
      const int index = part * 8 + i;  // the last two come again in the next file
      writer.write("imu/data", sample_imu(index).stamp_ns, sample_imu(index));
    }
  }
  const auto log = open_log(bag.string(), RobotConfig{}, only_imu());
  EXPECT_THAT(log->summary().faults, ElementsAre(HasSubstr("no metadata.yaml")));
  const auto entries = read_all(*log);
  ASSERT_EQ(110U, entries.size());
  EXPECT_TRUE(std::is_sorted(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    return a.receive_ns < b.receive_ns;
  }));
  std::ofstream(bag / "metadata.yaml")
      << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  "
         "relative_file_paths: [drive_0.mcap, drive_1.mcap]\n";
  EXPECT_EQ(20U, read_all(*open_log(bag.string(), RobotConfig{}, only_imu())).size());
}

/// A recorder that has no clock yet writes zero.
TEST(Mcap, a_message_of_time_zero_hides_no_other_in_either_storage) {
  TemporaryFolder folder;
  for (const Storage storage : {Storage::kMcap, Storage::kSqlite3}) {
    const auto path = folder / (storage == Storage::kMcap ? "mcap" : "sqlite3");
    {
      Rosbag2Writer writer(path.string(), storage);
      writer.write("imu/data", 0, sample_imu(-1));
      write_drive(writer);
    }
    EXPECT_EQ(121U, hear(path).entries.size()) << path;
    const auto log = open_log(path.string(), RobotConfig{});
    EXPECT_EQ(0, log->summary().first_ns);
    EXPECT_EQ(sample_imu(99).stamp_ns, log->summary().last_ns);
  }
}

TEST(Mcap, is_known_by_its_first_bytes_whatever_it_is_called) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "drive.mcap").string());
    write_drive(writer);
  }
  fs::rename(folder / "drive.mcap", folder / "download");
  EXPECT_EQ(120U, hear(folder / "download").entries.size());
}

TEST(Mcap, a_killed_recorder_leaves_what_it_flushed) {
  TemporaryFolder folder;
  const auto path = folder / "log";
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Rosbag2Writer writer(path.string(), Storage::kMcap);
    write_drive(writer);
    writer.flush();
    writer.write("imu/data", sample_imu(100).stamp_ns, sample_imu(100));  // not durable yet
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  const Heard heard = hear(path);
  EXPECT_TRUE(heard.entries == drive_in_order());
  EXPECT_EQ("", heard.error);
  EXPECT_THAT(heard.faults,
              ElementsAre(HasSubstr("no metadata.yaml"),
                          AllOf(HasSubstr("log_0.mcap"), HasSubstr("recorder was killed"))));
}

TEST(Mcap, is_durable_about_once_a_second_without_being_asked) {
  TemporaryFolder folder;
  const auto file = folder / "drive.mcap";
  Rosbag2Writer writer(file.string());
  const auto empty_size = fs::file_size(file);
  constexpr std::uint32_t kPoints = 100'000;  // 1.6 MB
  for (int i = 0; i < 3; ++i) {
    writer.write("points", kStart_ns + i, sample_cloud(i, kPoints));
  }
  EXPECT_GT(fs::file_size(file), empty_size) << "by size";
  EXPECT_EQ(3U, writer.messages_written());
}

TEST(Mcap, a_full_disk_is_told_and_keeps_what_was_written_with_its_summary) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  constexpr std::uint64_t kLimit_bytes = 60'000;
  Rosbag2Writer writer(path, Storage::kMcap, kLimit_bytes);
  const auto told = message_of<LogError>([&] {
    for (int i = 0; i < 1000; ++i) {
      writer.write("points", kStart_ns + i * 100 * kMillisecond_ns, sample_cloud(i, 1000));
      writer.flush();
    }
  });
  EXPECT_THAT(told, AllOf(HasSubstr("No space left"), HasSubstr("log_0.mcap")));
  const auto kept = writer.messages_written();
  EXPECT_GT(kept, 5U);
  EXPECT_THAT(told, HasSubstr(std::to_string(kept) + " messages"));
  EXPECT_THROW(writer.write("points", kStart_ns, sample_cloud(0)), LogError);
  EXPECT_LE(fs::file_size(folder / "log" / "log_0.mcap"), kLimit_bytes);

  LogOptions points_alone;
  points_alone.require_imu = false;
  points_alone.require_fix = false;
  const auto log = open_log(path, RobotConfig{}, points_alone);
  EXPECT_THAT(log->summary().faults, IsEmpty()) << "it has its end and metadata.yaml";
  EXPECT_EQ(kept, read_all(*log).size());
}

/// A limit on the size of each file: no room that is given back helps, so that the end is missing.
TEST(Mcap, on_a_disk_that_takes_no_more_what_was_written_before_is_readable_and_counted) {
  TemporaryFolder folder;
  const auto path = (folder / "log").string();
  std::string told;
  {
    const tests::SmallDisk disk(9U << 20U);
    told = message_of<LogError>([&] {
      Rosbag2Writer writer(path, Storage::kMcap);
      std::uint32_t noise = 1;
      for (int i = 0; i < 1000; ++i) {
        auto cloud = sample_cloud(i % 50, 5000);
        for (std::uint8_t& byte : cloud.data) {  // so that it can't be compressed
          noise = noise * 1664525U + 1013904223U;
          byte = static_cast<std::uint8_t>(noise >> 24U);
        }
        writer.write("points", kStart_ns + i * kMillisecond_ns, cloud);
      }
    });
  }
  LogOptions points_alone;
  points_alone.require_imu = false;
  points_alone.require_fix = false;
  const auto kept = read_all(*open_log(path, RobotConfig{}, points_alone)).size();
  EXPECT_GT(kept, 50U);
  EXPECT_THAT(told, HasSubstr("with " + std::to_string(kept) + " messages"));
}

TEST(Mcap, never_writes_over_another_recording) {
  TemporaryFolder folder;
  write_bytes(folder / "drive.mcap", "x");
  EXPECT_THAT(message_of<LogError>([&] { Rosbag2Writer((folder / "drive.mcap").string()); }),
              HasSubstr("exists"));
  EXPECT_EQ("x", bytes_of(folder / "drive.mcap"));
}

TEST(Mcap, a_file_named_reserve_beside_a_single_file_stays) {
  TemporaryFolder folder;
  write_bytes(folder / "reserve", "mine");
  {
    Rosbag2Writer writer((folder / "drive.mcap").string());
    write_drive(writer);
  }
  EXPECT_EQ("mine", bytes_of(folder / "reserve"));
}

/// A file with a header, made by hand.
RecordWriter begun(const std::string& profile = "ros2") {
  RecordWriter file;
  file.bytes(mcap::kMagic);
  file.header({profile, "test"});
  return file;
}

void write_file(const fs::path& path, const RecordWriter& file) {
  write_bytes(path, {file.content().begin(), file.content().end()});
}

void add_end(RecordWriter& file) {
  file.data_end(0);
  file.footer({});
  file.bytes(mcap::kMagic);
}

TEST(Mcap, blocks_that_do_not_fit_into_memory_together_are_read_again) {
  TemporaryFolder folder;
  const auto path = folder / "drive.mcap";
  {
    Rosbag2Writer writer(path.string());
    for (int first = 0; first < 5; ++first) {  // five chunks over the same time
      for (int i = first; i < 500; i += 5) {
        writer.write("imu/data", sample_imu(i).stamp_ns, sample_imu(i));
      }
      writer.flush();
    }
  }
  constexpr std::uint64_t kOneChunk_bytes = 40'000;
  const auto file = open_mcap_file(path, kOneChunk_bytes);
  file->select({"/imu/data"});
  int count = 0;
  while (const auto raw = file->next()) {
    EXPECT_EQ(sample_imu(count++).stamp_ns, raw->receive_ns);
  }
  EXPECT_EQ(500, count);
}

TEST(Mcap, an_encoding_that_is_not_known_is_refused_by_name_when_it_is_asked_for) {
  TemporaryFolder folder;
  RecordWriter file = begun();
  file.schema({1, "sensor_msgs/msg/Imu", "jsonschema", "{}"});
  file.channel({1, 1, "/imu/data", "json", {}});
  const std::vector<std::uint8_t> data{'{', '}'};
  file.message({1, 0, kStart_ns, kStart_ns}, data);
  add_end(file);
  write_file(folder / "json.mcap", file);
  const auto told = message_of<LogError>(
      [&] { open_log((folder / "json.mcap").string(), RobotConfig{}, only_imu()); });
  EXPECT_THAT(told, AllOf(HasSubstr("encoded as 'json, jsonschema'"), HasSubstr("'imu/data'")));
}

TEST(Mcap, a_compression_that_is_not_known_is_named) {
  TemporaryFolder folder;
  RecordWriter file = begun();
  const std::vector<std::uint8_t> rubbish(100, 7);
  file.chunk({kStart_ns, kStart_ns, 100, 0, "brotli", 0}, rubbish);
  add_end(file);
  write_file(folder / "a.mcap", file);
  EXPECT_THAT(hear(folder / "a.mcap").error, HasSubstr("'brotli' is not known"));
}

TEST(Mcap, messages_of_a_channel_that_is_not_described_are_told) {
  TemporaryFolder folder;
  {
    Rosbag2Writer writer((folder / "a.mcap").string());
    write_drive(writer);
  }
  std::string bytes = bytes_of(folder / "a.mcap");
  RecordWriter strange;
  const std::vector<std::uint8_t> data(10, 7);
  strange.message({77, 0, kStart_ns, kStart_ns}, data);
  const std::string record(strange.content().begin(), strange.content().end());
  // Behind the header, whose 8 + 9 + 21 bytes are those of profile ros2 and library trigpoint.
  bytes.insert(38, record);
  bytes.resize(bytes.size() - 100);
  write_bytes(folder / "a.mcap", bytes);
  const Heard heard = hear(folder / "a.mcap");
  EXPECT_EQ(120U, heard.entries.size());
  EXPECT_THAT(heard.error, HasSubstr("1 messages are of channels that the file does not describe"));
}

TEST(Mcap, compressed_bags_of_rosbag2_are_refused_with_a_way_out) {
  TemporaryFolder folder;
  write_bytes(folder / "drive_0.mcap.zstd", "rubbish");
  EXPECT_THAT(message_of<LogError>(
                  [&] { open_log((folder / "drive_0.mcap.zstd").string(), RobotConfig{}); }),
              HasSubstr("zstd -d drive_0.mcap.zstd -o drive_0.mcap"));
  write_bytes(folder / "metadata.yaml",
              "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  "
              "compression_format: zstd\n  compression_mode: MESSAGE\n  relative_file_paths: "
              "[a.mcap]\n");
  EXPECT_THAT(
      message_of<LogError>([&] { open_log(folder.path().string(), RobotConfig{}); }),
      AllOf(HasSubstr("storage 'mcap' compressed with zstd"), HasSubstr("ros2 bag convert")));
}

}  // namespace
}  // namespace trigpoint::recording
