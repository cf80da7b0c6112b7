// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP between us and another house (read_mcap.mjs, write_mcap.mjs): what we record is read there,
// by the definitions that our file brings, equal in every value, and what is written there is read
// here. Needs node and, in the folder that TRIGPOINT_NODE_MODULES names, npm's packages
// (npm install --prefix FOLDER @mcap/core @mcap/nodejs @foxglove/rosmsg
// @foxglove/rosmsg-serialization
// @foxglove/rosmsg2-serialization @foxglove/rosmsg-msgs-common @foxglove/wasm-zstd lz4js); says
// that it skips without.
#include "mcap_drive.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>

namespace trigpoint::recording {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::array<const char*, 8> kPackages{"@mcap/core",
                                               "@mcap/nodejs",
                                               "@foxglove/rosmsg",
                                               "@foxglove/rosmsg-serialization",
                                               "@foxglove/rosmsg2-serialization",
                                               "@foxglove/rosmsg-msgs-common",
                                               "@foxglove/wasm-zstd",
                                               "lz4js"};

/// Empty when a package is missing.
std::string node_modules() {
  const char* folder = std::getenv("TRIGPOINT_NODE_MODULES");
  const auto there = [folder](const char* package) {
    return std::filesystem::exists(std::string(folder) + "/" + package);
  };
  return folder != nullptr && std::all_of(kPackages.begin(), kPackages.end(), there) ? folder : "";
}

tests::CommandResult run_script(const char* script, std::vector<std::string> arguments) {
  const std::string folder = std::string(TRIGPOINT_SOURCE_DIR) + "/tests/unit/recording/";
  arguments.insert(arguments.begin(), {"node", folder + script, node_modules()});
  return tests::run_command(arguments);
}

std::vector<json> lines_of(const std::string& output) {
  std::vector<json> lines;
  std::istringstream stream(output);
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(json::parse(line));
  }
  return lines;
}

Nanoseconds stamp_of(const json& message) {
  const json& stamp = message["value"]["header"]["stamp"];
  return stamp["sec"].get<Nanoseconds>() * kNanosecondsPerSecond +
         stamp["nanosec"].get<Nanoseconds>();
}

Eigen::Vector3d vector_of(const json& value) {
  return {value["x"].get<double>(), value["y"].get<double>(), value["z"].get<double>()};
}

void expect_imu(const json& message, int index) {
  const ImuSample imu = sample_imu(index);
  const json& value = message["value"];
  EXPECT_EQ(message["type"], "sensor_msgs/msg/Imu");
  EXPECT_EQ(stamp_of(message), imu.stamp_ns);
  EXPECT_EQ(message["logTime"], std::to_string(imu.stamp_ns));
  EXPECT_EQ(message["sequence"], index);
  EXPECT_EQ(value["header"]["frame_id"], imu.frame_id);
  EXPECT_EQ(vector_of(value["angular_velocity"]), imu.gyro_radps);
  EXPECT_EQ(vector_of(value["linear_acceleration"]), imu.accel_mps2);
  EXPECT_EQ(vector_of(value["orientation"]), imu.q_world_base->vec());
  EXPECT_EQ(value["orientation"]["w"], imu.q_world_base->w());
}

void expect_fix(const json& message, int index) {
  const GnssFix fix = sample_fix(index);
  const json& value = message["value"];
  EXPECT_EQ(message["type"], "sensor_msgs/msg/NavSatFix");
  EXPECT_EQ(stamp_of(message), fix.stamp_ns);
  EXPECT_EQ(message["logTime"], std::to_string(fix.stamp_ns + 50 * kMillisecond_ns));
  EXPECT_EQ(value["header"]["frame_id"], fix.frame_id);
  EXPECT_EQ(value["status"]["status"], static_cast<int>(fix.status));
  EXPECT_EQ(value["status"]["service"], fix.service);
  EXPECT_EQ(value["latitude"], fix.latitude_deg);
  EXPECT_EQ(value["longitude"], fix.longitude_deg);
  EXPECT_EQ(value["altitude"], fix.altitude_m);
  for (Eigen::Index i = 0; i < 9; ++i) {
    EXPECT_EQ(value["position_covariance"][static_cast<std::size_t>(i)],
              fix.covariance_enu_m2(i / 3, i % 3));
  }
  EXPECT_EQ(value["position_covariance_type"], static_cast<int>(fix.covariance_type));
}

void expect_cloud(const json& message, int index) {
  const PointCloudMessage cloud = sample_cloud(index);
  const json& value = message["value"];
  EXPECT_EQ(message["type"], "sensor_msgs/msg/PointCloud2");
  EXPECT_EQ(stamp_of(message), cloud.stamp_ns);
  EXPECT_EQ(value["header"]["frame_id"], cloud.frame_id);
  EXPECT_EQ(value["height"], cloud.height);
  EXPECT_EQ(value["width"], cloud.width);
  EXPECT_EQ(value["point_step"], cloud.point_step);
  EXPECT_EQ(value["row_step"], cloud.row_step);
  ASSERT_EQ(value["fields"].size(), cloud.fields.size());
  for (std::size_t i = 0; i < cloud.fields.size(); ++i) {
    EXPECT_EQ(value["fields"][i]["name"], cloud.fields[i].name);
    EXPECT_EQ(value["fields"][i]["offset"], cloud.fields[i].offset);
    EXPECT_EQ(value["fields"][i]["datatype"], cloud.fields[i].datatype);
  }
  EXPECT_EQ(value["data"].get<std::vector<std::uint8_t>>(), cloud.data);
}

/// Returns how many messages it has compared.
int expect_drive(const std::vector<json>& lines) {
  std::map<std::string, int> next;
  int messages = 0;
  for (const json& line : lines) {
    if (!line.contains("topic")) {
      continue;
    }
    ++messages;
    const std::string topic = line["topic"];
    const int index = next[topic]++;
    if (topic == "/imu/data") {
      expect_imu(line, index);
    } else if (topic == "/gps/fix") {
      expect_fix(line, index);
    } else {
      EXPECT_EQ(topic, "/points");
      expect_cloud(line, index);
    }
  }
  return messages;
}

class McapOfAnotherHouse : public ::testing::Test {
 protected:
  void SetUp() override {
    if (node_modules().empty()) {
      GTEST_SKIP() << "TRIGPOINT_NODE_MODULES names no folder that holds the npm packages of "
                      "Foxglove for MCAP";
    }
  }
};

TEST_F(McapOfAnotherHouse, reads_every_value_that_we_recorded_by_the_definitions_in_the_file) {
  TemporaryFolder folder;
  const auto file = folder / "drive.mcap";
  {
    Rosbag2Writer writer(file.string());
    writer.declare_topic("datum", "sensor_msgs/msg/NavSatFix", Durability::kTransientLocal);
    writer.declare_topic("fusion/status", "trigpoint_msgs/msg/FusionStatus", Durability::kVolatile);
    write_drive(writer, 7);
    writer.close();
  }
  const auto read = run_script("read_mcap.mjs", {file.string()});
  ASSERT_EQ(read.exit_code, 0) << read.output;
  const auto lines = lines_of(read.output);
  EXPECT_EQ(expect_drive(lines), kDriveMessages);

  const json& about = lines.front();
  EXPECT_EQ(about["header"]["profile"], "ros2");
  EXPECT_EQ(about["statistics"]["messageCount"], std::to_string(kDriveMessages));
  EXPECT_EQ(about["statistics"]["messageStartTime"], std::to_string(kStart_ns));
  EXPECT_EQ(about["statistics"]["channelCount"], 5);
  EXPECT_EQ(about["statistics"]["schemaCount"], 4);
  EXPECT_EQ(about["chunks"], 18) << "120 / 7, the last one is shorter";
  EXPECT_THAT(about["metadata"]["rosbag2"]["serialized_metadata"].get<std::string>(),
              HasSubstr("storage_identifier: mcap"));
  ASSERT_EQ(about["channels"].size(), 5);
  EXPECT_EQ(about["channels"][0]["topic"], "/datum");
  EXPECT_EQ(about["channels"][0]["messageEncoding"], "cdr");
  EXPECT_EQ(about["channels"][0]["schemaEncoding"], "ros2msg");
  EXPECT_THAT(about["channels"][0]["metadata"]["offered_qos_profiles"].get<std::string>(),
              HasSubstr("durability: 1"));
}

TEST_F(McapOfAnotherHouse, finds_every_record_and_crc_of_ours_in_order_from_end_to_end) {
  TemporaryFolder folder;
  const auto file = folder / "drive.mcap";
  {
    Rosbag2Writer writer(file.string());
    write_drive(writer, 50);
  }
  const auto read = run_script("read_mcap.mjs", {file.string(), "stream"});
  ASSERT_EQ(read.exit_code, 0) << read.output;
  const auto lines = lines_of(read.output);
  EXPECT_EQ(expect_drive(lines), kDriveMessages);
  const json& end = lines.back();
  EXPECT_EQ(end["done"], true);
  EXPECT_EQ(end["kinds"]["Chunk"], 3);
  EXPECT_EQ(end["kinds"]["ChunkIndex"], 3);
  EXPECT_EQ(end["kinds"]["MessageIndex"], 9);
  EXPECT_EQ(end["kinds"]["Schema"], 6) << "each in a chunk and in the summary";
  EXPECT_EQ(end["kinds"]["Channel"], 6);
  EXPECT_EQ(end["kinds"]["Statistics"], 1);
  EXPECT_EQ(end["kinds"]["SummaryOffset"], 5);
  EXPECT_EQ(end["kinds"]["Footer"], 1);
}

TEST_F(McapOfAnotherHouse, writes_files_of_every_kind_that_are_read_here) {
  TemporaryFolder folder;
  const auto written = run_script("write_mcap.mjs", {folder.path().string()});
  ASSERT_EQ(written.exit_code, 0) << written.output;
  int kinds = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    ++kinds;
    const Heard heard = hear(entry.path());
    const std::string name = entry.path().filename().string();
    EXPECT_EQ(heard.error, "") << name;
    EXPECT_THAT(heard.faults, ElementsAre()) << name;
    EXPECT_FALSE(heard.undecodable) << name;
    EXPECT_TRUE(is_in_order_of_arrival(heard.entries)) << name;
    EXPECT_TRUE(without_order(heard.entries) == without_order(drive_in_order())) << name;
  }
  EXPECT_EQ(kinds, 13);
}

}  // namespace
}  // namespace trigpoint::recording
