// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The trigpoint command as a user meets it, mistakes included.
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

constexpr Nanoseconds kStart_ns = 1'700'000'000'000'000'000;

std::string program() {
  return std::string(TRIGPOINT_BIN_DIR) + "/trigpoint";
}

CommandResult trigpoint(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program());
  return run_command(arguments, 60s, {{"ROS_DOMAIN_ID", tests::own_domain()}});
}

/// A cloud of a wall, 5 m ahead; with or without point times.
PointCloudMessage wall(Nanoseconds stamp_ns, bool with_time) {
  PointCloud cloud;
  for (int i = 0; i < 2000; ++i) {
    cloud.push_back(
        {5.0F, 0.01F * static_cast<float>(i % 100), 0.05F * static_cast<float>(i / 100), 1.0F});
  }
  PointCloudMessage message = to_cloud_message(cloud, stamp_ns, "lidar");
  if (with_time) {
    message.fields.back().name = "time";
  }
  return message;
}

struct BagContents {
  bool imu{true};
  bool points{true};
  bool point_times{true};
  double gravity{9.81};
};

void write_bag(const std::string& folder, const BagContents& contents) {
  recording::Rosbag2Writer writer(folder);
  for (int i = 0; i < 400; ++i) {
    const Nanoseconds stamp_ns = kStart_ns + i * 10'000'000LL;
    if (contents.imu) {
      ImuSample sample;
      sample.stamp_ns = stamp_ns;
      sample.frame_id = "imu";
      sample.accel_mps2 = {0.0, 0.0, contents.gravity};
      writer.write("imu/data", stamp_ns, sample);
    }
    if (contents.points && i % 10 == 9) {
      writer.write("points", stamp_ns, wall(stamp_ns, contents.point_times));
    }
    if (i % 20 == 0) {
      GnssFix fix;
      fix.stamp_ns = stamp_ns;
      fix.frame_id = "gnss";
      fix.status = FixStatus::kGbas;
      fix.latitude_deg = 43.9;
      fix.longitude_deg = -78.9;
      fix.altitude_m = 100.0;
      fix.covariance_enu_m2 = Eigen::Matrix3d::Identity() * 4e-4;
      fix.covariance_type = CovarianceType::kDiagonalKnown;
      writer.write("gps/fix", stamp_ns, fix);
    }
  }
  writer.close();
}

TEST(Command, every_verb_has_help) {
  for (const char* verb : {"map",
                           "simulate",
                           "info",
                           "play",
                           "record",
                           "evaluate",
                           "report",
                           "export",
                           "config",
                           "doctor"}) {
    const CommandResult result = trigpoint({verb, "--help"});
    EXPECT_EQ(result.exit_code, 0) << verb;
    EXPECT_THAT(result.output, HasSubstr("--help")) << verb;
  }
}

TEST(Command, an_unknown_verb_or_option_is_a_usage_error) {
  EXPECT_EQ(trigpoint({"mapp"}).exit_code, 2);
  EXPECT_EQ(trigpoint({"map", "short", "--outt", "x"}).exit_code, 2);
  EXPECT_EQ(trigpoint({}).exit_code, 2);
}

TEST(Command, a_missing_log_is_named) {
  const TemporaryFolder folder;
  const CommandResult result = trigpoint({"map", "/no/such/drive.bag", "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("/no/such/drive.bag"));
}

TEST(Command, a_mistyped_configuration_key_is_refused_with_file_line_and_suggestion) {
  const TemporaryFolder folder;
  tests::write_file(folder.path("c.yaml"), "fusion_gate:\n  mdoe: lio\n");
  const CommandResult result =
      trigpoint({"map", "short", "--config", folder.path("c.yaml"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("c.yaml:2"), HasSubstr("did you mean 'mode'")));
}

TEST(Command, a_bag_without_imu_is_refused_and_says_what_is_there) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.imu = false});
  const CommandResult result = trigpoint({"map", folder.path("bag"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("imu/data"), HasSubstr("points")));
}

TEST(Command, an_unknown_topic_is_refused_with_what_is_there) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {});
  tests::write_file(folder.path("c.yaml"), "robot: {imu_topic: imu/dta}\n");
  const CommandResult result = trigpoint(
      {"map", folder.path("bag"), "--config", folder.path("c.yaml"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("imu/dta"), HasSubstr("imu/data")));
}

TEST(Command, points_without_time_are_refused_with_the_field_s_name) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.point_times = false});
  const CommandResult result = trigpoint({"map", folder.path("bag"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("time"), HasSubstr("points_without_time")));
}

TEST(Command, imu_in_g_is_refused_with_the_value_and_the_unit) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.gravity = 1.0});
  const CommandResult result = trigpoint({"map", folder.path("bag"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("m/s"), HasSubstr(" g")));
}

TEST(Command, doctor_finds_the_same_faults_in_a_log) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.point_times = false, .gravity = 1.0});
  const CommandResult result = trigpoint({"doctor", folder.path("bag")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("it is in g"), HasSubstr("carry no time")));
}

TEST(Command, doctor_shows_what_there_is_where_a_topic_is_missing) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.imu = false});
  const CommandResult result = trigpoint({"doctor", folder.path("bag")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("points"),
                    HasSubstr("messages"),
                    HasSubstr("! imu/data: no message of type sensor_msgs/msg/Imu")));
}

TEST(Command, info_and_doctor_tell_that_the_recorder_was_killed) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {});
  std::filesystem::remove(folder.path("bag") + "/metadata.yaml");
  for (const char* verb : {"info", "doctor"}) {
    const CommandResult result = trigpoint({verb, folder.path("bag")});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.output, HasSubstr("no metadata.yaml")) << verb;
  }
}

TEST(Command, info_tells_topics_and_counts_also_where_one_is_missing) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.points = false});
  const CommandResult result = trigpoint({"info", folder.path("bag")});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, AllOf(HasSubstr("imu/data"), HasSubstr("400")));
}

TEST(Command, an_empty_log_is_refused) {
  const TemporaryFolder folder;
  tests::write_file(folder.path("empty.bag"), "");
  const CommandResult bag = trigpoint({"map", folder.path("empty.bag"), "--out", folder.path("s")});
  EXPECT_EQ(bag.exit_code, 1);
  EXPECT_THAT(bag.output, HasSubstr("empty.bag"));
}

TEST(Command, a_truncated_log_is_used_up_to_its_break) {
  const TemporaryFolder folder;
  ASSERT_EQ(
      trigpoint({"simulate", "short", "--duration", "8", "--out", folder.path("drive")}).exit_code,
      0);
  fs::path database;
  for (const auto& entry : fs::directory_iterator(folder.path("drive/log"))) {
    if (entry.path().extension() == ".db3") {
      database = entry.path();
    }
  }
  fs::resize_file(database, fs::file_size(database) * 7 / 10);
  const CommandResult result = trigpoint({"map", folder.path("drive"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr(database.filename().string()));
}

TEST(Command, a_full_disk_is_named_and_ends_with_a_failure) {
  if (!fs::exists("/dev/full")) {
    GTEST_SKIP() << "this system has no /dev/full";
  }
  const TemporaryFolder folder;
  fs::create_directories(folder.path("s"));
  fs::create_symlink("/dev/full", folder.path("s/lio.tum"));
  const CommandResult result =
      trigpoint({"map", "short", "--duration", "6", "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_THAT(result.output, HasSubstr("lio.tum"));
}

TEST(Command, config_prints_what_it_reads) {
  const TemporaryFolder folder;
  const CommandResult defaults = trigpoint({"config"});
  ASSERT_EQ(defaults.exit_code, 0);
  tests::write_file(folder.path("c.yaml"), defaults.output);
  const CommandResult again = trigpoint({"config", "--config", folder.path("c.yaml")});
  EXPECT_EQ(again.exit_code, 0) << again.output;
  EXPECT_EQ(again.output, defaults.output);
}

TEST(Command, the_shipped_configuration_is_what_the_structs_print) {
  EXPECT_EQ(trigpoint({"config"}).output,
            tests::read_file(std::string(TRIGPOINT_SOURCE_DIR) + "/config/trigpoint.yaml"));
}

TEST(Command, presets_are_accepted) {
  for (const auto& entry :
       fs::directory_iterator(std::string(TRIGPOINT_SOURCE_DIR) + "/config/presets")) {
    const CommandResult result = trigpoint({"config", "--config", entry.path().string()});
    EXPECT_EQ(result.exit_code, 0) << entry.path() << ": " << result.output;
  }
}

TEST(Command, evaluate_tells_a_known_offset) {
  const TemporaryFolder folder;
  std::string reference;
  std::string estimate;
  for (int i = 0; i < 50; ++i) {
    const std::string stamp = std::to_string(1000 + i) + ".000000000 ";
    const std::string y = " " + std::to_string(i % 7) + " 0 0 0 0 1\n";
    reference += stamp + std::to_string(i) + y;
    estimate += stamp + std::to_string(i + 3) + y;
  }
  tests::write_file(folder.path("r.tum"), reference);
  tests::write_file(folder.path("e.tum"), estimate);
  const CommandResult result = trigpoint({"evaluate", folder.path("e.tum"), folder.path("r.tum")});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("50 pairs"), HasSubstr("3.000"), HasSubstr("coverage 100.0 %")));
}

TEST(Command, record_hears_what_play_says) {
  const TemporaryFolder folder;
  const std::map<std::string, std::string> environment{{"ROS_DOMAIN_ID", tests::own_domain(50)}};
  tests::Command recorder({program(), "record", "--out", folder.path("bag"), "--duration", "12"},
                          environment);
  const CommandResult played =
      run_command({program(), "play", "short", "--duration", "3", "--rate", "1", "--wait", "2"},
                  60s,
                  environment);
  EXPECT_EQ(played.exit_code, 0) << played.output;
  const CommandResult recorded = recorder.wait(60s);
  EXPECT_EQ(recorded.exit_code, 0) << recorded.output;
  EXPECT_THAT(trigpoint({"info", folder.path("bag")}).output,
              AllOf(HasSubstr("imu/data"), HasSubstr("points"), HasSubstr("gps/fix")));
}

TEST(Command, doctor_tells_when_nobody_is_on_the_bus) {
  const CommandResult result = run_command(
      {program(), "doctor", "--seconds", "1"}, 30s, {{"ROS_DOMAIN_ID", tests::own_domain(51)}});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("nobody writes"));
}

}  // namespace
}  // namespace trigpoint
