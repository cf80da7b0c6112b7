// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The trigpoint command as a user meets it, mistakes included.
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <iterator>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
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
                           "live",
                           "evaluate",
                           "report",
                           "reproduce",
                           "export",
                           "merge",
                           "gps-plots",
                           "config",
                           "doctor"}) {
    const CommandResult result = trigpoint({verb, "--help"});
    EXPECT_EQ(result.exit_code, 0) << verb;
    EXPECT_THAT(result.output, HasSubstr("--help")) << verb;
  }
}

TEST(Command, an_unknown_verb_or_option_is_a_usage_error) {
  const CommandResult unknown = trigpoint({"mapp"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.output, AllOf(HasSubstr("no verb 'mapp'"), HasSubstr("simulate")));
  EXPECT_EQ(trigpoint({"map", "short", "--outt", "x"}).exit_code, 2);
  EXPECT_EQ(trigpoint({}).exit_code, 2);
}

TEST(Command, a_missing_log_is_named) {
  const TemporaryFolder folder;
  const CommandResult result = trigpoint({"map", "/no/such/drive.bag", "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("/no/such/drive.bag"), HasSubstr("campus, ")));
  EXPECT_FALSE(fs::exists(folder.path("s")));
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
  EXPECT_EQ(result.exit_code, 2);
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

TEST(Command, a_wrong_number_is_a_usage_error_and_leaves_nothing) {
  const TemporaryFolder folder;
  const std::vector<std::vector<std::string>> wrong{{"map", "short", "--duration", "inf"},
                                                    {"map", "short", "--duration", "1e400"},
                                                    {"map", "short", "--duration", "nan"},
                                                    {"map", "short", "--duration", "-5"},
                                                    {"map", "short", "--duration", "0"},
                                                    {"map", "short", "--seed", "-1"},
                                                    {"map", "short", "--seed", "1e23"},
                                                    {"map", "short", "--mode", "nonsense"},
                                                    {"simulate", "short", "--duration", "1e9"},
                                                    {"simulate", "shrt"},
                                                    {"gps-plots", "--outage", "-1"},
                                                    {"gps-plots", "--outage", "1e9"},
                                                    {"gps-plots", "--scenario", "shrt"},
                                                    {"record", "--duration", "-1"}};
  for (std::vector<std::string> arguments : wrong) {
    arguments.insert(arguments.end(), {"--out", folder.path("s")});
    const CommandResult result = trigpoint(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments.back() << result.output;
    EXPECT_FALSE(fs::exists(folder.path("s"))) << result.output;
  }
  EXPECT_EQ(trigpoint({"info", "short", "--duration", "inf"}).exit_code, 2);
  EXPECT_EQ(trigpoint({"play", "short", "--rate", "0"}).exit_code, 2);
  EXPECT_THAT(trigpoint({"simulate", "shrt", "--out", folder.path("s")}).output,
              HasSubstr("campus, "));
}

TEST(Command, a_seed_for_a_recorded_drive_is_refused) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {});
  const CommandResult result = trigpoint({"info", folder.path("bag"), "--seed", "2"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("--seed"));
  EXPECT_EQ(trigpoint({"info", folder.path("bag/metadata.yaml")}).exit_code, 0);
}

TEST(Command, results_are_never_written_over_others) {
  const TemporaryFolder folder;
  for (const char* name : {"fused.tum", "truth.tum"}) {
    const std::string used = folder.path(name) + ".d";
    fs::create_directories(used);
    tests::write_file(used + "/" + name, "mine");
    for (const std::vector<std::string>& verb :
         {std::vector<std::string>{"map", "short"}, {"simulate", "short"}, {"record"}}) {
      std::vector<std::string> arguments = verb;
      arguments.insert(arguments.end(), {"--duration", "1", "--out", used});
      const CommandResult result = trigpoint(arguments);
      EXPECT_EQ(result.exit_code, 2) << verb.front() << result.output;
      EXPECT_THAT(result.output, HasSubstr(used));
    }
    EXPECT_EQ(tests::read_file(used + "/" + name), "mine");
    const auto files = fs::directory_iterator(used);
    EXPECT_EQ(std::distance(begin(files), end(files)), 1);
  }
}

TEST(Command, an_interrupted_map_or_simulation_says_so_and_keeps_what_was_done) {
  const TemporaryFolder folder;
  tests::Command map({program(), "map", "campus", "--out", folder.path("s")});
  tests::Command simulation({program(), "simulate", "campus", "--out", folder.path("d")});
  std::this_thread::sleep_for(6s);
  map.signal(SIGINT);
  simulation.signal(SIGINT);
  const CommandResult mapped = map.wait(60s);
  const CommandResult simulated = simulation.wait(60s);
  EXPECT_EQ(mapped.exit_code, 130) << mapped.output;
  EXPECT_THAT(mapped.output, HasSubstr("interrupted"));
  EXPECT_TRUE(fs::exists(folder.path("s/report.md")));
  EXPECT_EQ(simulated.exit_code, 130) << simulated.output;
  EXPECT_THAT(simulated.output, HasSubstr("interrupted"));
  EXPECT_TRUE(fs::exists(folder.path("d/log/metadata.yaml")));
  EXPECT_EQ(trigpoint({"info", folder.path("d")}).exit_code, 0);
}

TEST(Command, what_cannot_be_printed_is_a_failure) {
  if (!fs::exists("/dev/full")) {
    GTEST_SKIP() << "this system has no /dev/full";
  }
  const CommandResult result = run_command({"sh", "-c", program() + " config >/dev/full"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("standard output"));
}

TEST(Command, export_refuses_what_is_no_session_and_a_format_there_is_not) {
  const TemporaryFolder folder;
  ASSERT_EQ(
      trigpoint(
          {"simulate", "short", "--duration", "1", "--no-lidar", "--out", folder.path("drive")})
          .exit_code,
      0);
  const CommandResult result =
      trigpoint({"export", folder.path("drive"), "--out", folder.path("e")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("no session"));
  EXPECT_EQ(
      trigpoint({"export", folder.path("drive"), "--out", folder.path("e"), "--format", "laz"})
          .exit_code,
      2);
}

TEST(Command, export_writes_what_it_can_and_fails_for_what_was_asked_for_and_cannot_be) {
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  fs::create_directory(session);
  tests::write_file(session + "/fused.tum", "1.0 0 0 0 0 0 0 1\n2.0 5 0 0 0 0 0 1\n");
  const CommandResult las = trigpoint({"export", session, "--format", "las", "--format", "csv"});
  EXPECT_EQ(las.exit_code, 1);
  EXPECT_THAT(las.output, AllOf(HasSubstr("no datum.yaml"), HasSubstr("fused.csv  2 poses, map")));
  tests::write_file(session + "/datum.yaml",
                    "latitude_deg: 43.9\nlongitude_deg: -78.9\nheight_m: 100\nelected_ns: 0\n");
  const CommandResult again = trigpoint({"export", session});
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, HasSubstr("fused.csv already"));
  EXPECT_EQ(trigpoint({"export", session, "--out", session}).exit_code, 2);
  EXPECT_EQ(trigpoint({"export", session, "--out", folder.path("t"), "--tile", "0.5"}).exit_code,
            2);
  EXPECT_FALSE(fs::exists(folder.path("t")));
  const CommandResult all = trigpoint({"export", session, "--out", folder.path("all")});
  EXPECT_EQ(all.exit_code, 0) << all.output;
  EXPECT_THAT(all.output, AllOf(HasSubstr("session.kmz"), HasSubstr("no map"), HasSubstr("100 %")));
  EXPECT_THAT(trigpoint({"export", "--help"}).output, HasSubstr("LAS 1.4"));
}

TEST(Command, a_play_to_nobody_fails_unless_that_is_allowed) {
  const std::vector<std::string> play{"play", "short", "--duration", "1", "--wait", "1"};
  const CommandResult refused = trigpoint(play);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.output, HasSubstr("nobody listens"));
  std::vector<std::string> allowed = play;
  allowed.push_back("--allow-no-reader");
  EXPECT_EQ(trigpoint(allowed).exit_code, 0);
}

TEST(Command, a_play_into_the_session_of_another_one_is_refused) {
  const TemporaryFolder folder;
  fs::create_directories(folder.path("s"));
  tests::write_file(folder.path("s") + "/config.yaml", "");
  const std::vector<std::string> play{
      "play", "short", "--duration", "1", "--allow-no-reader", "--wait", "0", "--session"};
  std::vector<std::string> into = play;
  into.push_back(folder.path("s"));
  ASSERT_EQ(trigpoint(into).exit_code, 0);
  const std::string before = tests::read_file(folder.path("s") + "/fixes.csv");
  into[3] = "2";
  const CommandResult again = trigpoint(into);
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, AllOf(HasSubstr("--session"), HasSubstr("run.yaml")));
  EXPECT_EQ(tests::read_file(folder.path("s") + "/fixes.csv"), before);
}

/// Whoever starts the player: the report takes what was in flight for no loss.
TEST(Command, a_play_that_is_stopped_leaves_a_session_that_says_so) {
  const TemporaryFolder folder;
  const std::string session = folder.path("s");
  tests::Command play({program(),
                       "play",
                       "short",
                       "--rate",
                       "1",
                       "--allow-no-reader",
                       "--wait",
                       "0",
                       "--session",
                       session},
                      {{"ROS_DOMAIN_ID", tests::own_domain(52)}});
  const auto deadline = std::chrono::steady_clock::now() + 60s;
  while (!fs::exists(session + "/run.yaml") && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(20ms);
  }
  play.signal(SIGINT);
  EXPECT_EQ(play.wait(60s).exit_code, 130);
  EXPECT_THAT(tests::read_file(session + "/run.yaml"), HasSubstr("interrupted: true"));
}

TEST(Command, two_players_on_one_domain_are_refused_with_the_other_one_s_process) {
  const std::map<std::string, std::string> environment{{"ROS_DOMAIN_ID", tests::own_domain(52)}};
  const tests::Command first({program(), "play", "short", "--rate", "1", "--allow-no-reader"},
                             environment);
  std::this_thread::sleep_for(4s);
  const TemporaryFolder folder;
  for (const std::string& option :
       {std::string("--check"), std::string("--wait=0"), "--session=" + folder.path("refused")}) {
    const CommandResult second =
        run_command({program(), "play", "short", option}, 60s, environment);
    EXPECT_EQ(second.exit_code, 1) << second.output;
    EXPECT_THAT(second.output,
                AllOf(HasSubstr("imu/data"),
                      HasSubstr("process " + std::to_string(first.pid())),
                      HasSubstr("ROS_DOMAIN_ID")));
  }
  EXPECT_FALSE(fs::exists(folder.path("refused")));
}

TEST(Command, a_warning_that_repeats_is_told_once_with_its_number) {
  const TemporaryFolder folder;
  write_bag(folder.path("bag"), {.point_times = false});
  const CommandResult result = trigpoint({"map", folder.path("bag"), "--out", folder.path("s")});
  const std::string mark = "[points_without_time";
  EXPECT_EQ(result.output.find(mark), result.output.rfind(mark)) << result.output;
  EXPECT_THAT(result.output, HasSubstr("points_without_time: 39 more like this"));
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
              AllOf(HasSubstr("Pairs: 50"), HasSubstr("3.000"), HasSubstr("reference: 100.0 %")));
  const std::string json = folder.path("result.json");
  const std::vector<std::string> with_json{
      "evaluate", folder.path("e.tum"), folder.path("r.tum"), "--json", json};
  EXPECT_EQ(trigpoint(with_json).exit_code, 0);
  EXPECT_THAT(tests::read_file(json), HasSubstr("\"x_m\": {\"rmse\": 3, "));
  const CommandResult again = trigpoint(with_json);
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, HasSubstr("is there already"));
}

TEST(Command, a_mapped_drive_is_exported_and_scored_against_its_world) {
  const TemporaryFolder folder;
  const std::string session = folder.path("s");
  ASSERT_EQ(trigpoint({"map", "short", "--duration", "12", "--out", session}).exit_code, 0);
  const CommandResult exported = trigpoint({"export", session});
  EXPECT_EQ(exported.exit_code, 0) << exported.output;
  for (const char* file : {"map.las", "map.ply", "session.kmz", "height.tif", "trajectories.gpx"}) {
    EXPECT_GT(fs::file_size(session + "/export/" + file), 1000U) << file;
  }
  const CommandResult scored = trigpoint({"evaluate", session, "--map", "--scenario", "short"});
  ASSERT_EQ(scored.exit_code, 0) << scored.output;
  const std::string key = "Distance to the true surfaces: rmse ";
  const auto at = scored.output.find(key);
  ASSERT_NE(at, std::string::npos) << scored.output;
  constexpr double kGoodMap_m = 0.05;  // range noise 0.02 m, pose errors, cells of 0.1 m
  EXPECT_LT(std::stod(scored.output.substr(at + key.size())), kGoodMap_m);
  // In another world most walls are elsewhere.
  const CommandResult other =
      trigpoint({"evaluate", session, "--map", "--scenario", "short", "--seed", "2"});
  EXPECT_GT(std::stod(other.output.substr(other.output.find(key) + key.size())), kGoodMap_m);
}

TEST(Command, a_session_whose_keyframes_are_damaged_is_reported_all_the_same) {
  const TemporaryFolder folder;
  fs::create_directories(folder.path("s"));
  tests::write_file(folder.path("s") + "/keyframes.sqlite", "this is no database");
  const CommandResult result = trigpoint({"report", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("The map was not rendered"));
  EXPECT_THAT(tests::read_file(folder.path("s") + "/report.md"), HasSubstr("keyframes.sqlite"));
  fs::remove(folder.path("s") + "/report.md");
  fs::create_directory(folder.path("s") + "/report.md");  // it can't be written: a full disk
  const CommandResult full = trigpoint({"report", folder.path("s")});
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.output, AllOf(HasSubstr("The map was not rendered"), HasSubstr("report.md")));
}

TEST(Command, simulate_names_the_next_command_as_a_shell_takes_it) {
  const TemporaryFolder folder;
  const std::string drive = folder.path("it's a drive");
  const CommandResult result =
      trigpoint({"simulate", "short", "--duration", "1", "--no-lidar", "--out", drive});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const std::string words = result.output.substr(result.output.find("next: ") + 6);
  const CommandResult echo = run_command({"sh", "-c", "printf '<%s>' " + words});
  EXPECT_THAT(echo.output, HasSubstr("<" + drive + ">"));
}

TEST(Command, a_folder_that_is_no_session_is_a_usage_error) {
  const TemporaryFolder folder;
  for (const char* verb : {"evaluate", "report", "export"}) {
    const CommandResult result = trigpoint({verb, folder.path()});
    EXPECT_EQ(result.exit_code, 2) << verb << result.output;
    EXPECT_THAT(result.output, HasSubstr("session")) << verb;
  }
}

TEST(Command, evaluate_fails_when_a_file_of_the_session_cannot_be_read) {
  const TemporaryFolder folder;
  fs::create_directories(folder.path("s"));
  const std::string poses = "1700000000.0 0 0 0 0 0 0 1\n1700000000.1 1 0 0 0 0 0 1\n";
  for (const char* name : {"lio.tum", "truth.tum"}) {
    tests::write_file(folder.path("s") + "/" + name, "# poses\n" + poses);
  }
  EXPECT_EQ(trigpoint({"evaluate", folder.path("s")}).exit_code, 0);
  tests::write_file(folder.path("s") + "/fused.tum", "nonsense\n");
  const CommandResult result = trigpoint({"evaluate", folder.path("s")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("left out, "), HasSubstr("fused.tum:1")));
  EXPECT_EQ(trigpoint({"evaluate", folder.path("s") + "/lio.tum"}).exit_code, 2);
}

TEST(Command, record_hears_what_play_says) {
  const TemporaryFolder folder;
  const std::map<std::string, std::string> environment{{"ROS_DOMAIN_ID", tests::own_domain(50)}};
  tests::Command recorder({program(), "record", "--out", folder.path("bag"), "--duration", "12"},
                          environment);
  const CommandResult played =
      run_command({program(), "play", "short", "--duration", "3", "--rate", "1", "--wait", "3"},
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

TEST(Command, a_wrong_domain_is_all_that_is_said) {
  const TemporaryFolder folder;
  const std::vector<std::vector<std::string>> commands{
      {"doctor", "--seconds", "1"},
      {"doctor", "--gps-filter"},
      {"doctor", "--alive", "trigpoint_no_such_program"},
      {"live", "--port", "0"},
      {"record", "--out", folder.path("bag"), "--duration", "1"},
      {"play", "short"},
      {"config", "--check"}};
  for (std::vector<std::string> command : commands) {
    command.insert(command.begin(), program());
    const CommandResult result = run_command(command, 60s, {{"ROS_DOMAIN_ID", "abc"}});
    EXPECT_EQ(result.exit_code, 2) << command[1];
    EXPECT_EQ(result.output,
              "trigpoint: environment variable ROS_DOMAIN_ID is 'abc'; expected a whole number "
              "from 0 to 232\n");
  }
  EXPECT_FALSE(fs::exists(folder.path("bag")));
}

TEST(Command, config_checks_what_every_process_would_refuse) {
  const TemporaryFolder folder;
  const CommandResult right = trigpoint({"config", "--check"});
  EXPECT_EQ(right.exit_code, 0) << right.output;
  EXPECT_THAT(right.output,
              AllOf(HasSubstr("right; joins DDS domain " + tests::own_domain() + " with "),
                    Not(HasSubstr("robot:"))));
  tests::write_file(folder.path("c.yaml"), "bus: {initial_peers: [\"x\"]}\n");
  const CommandResult wrong = trigpoint({"config", "--check", "--config", folder.path("c.yaml")});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.output, HasSubstr("bus.initial_peers has 'x'"));
}

TEST(Command, a_recording_of_silence_leaves_no_bag) {
  const TemporaryFolder folder;
  const CommandResult result =
      trigpoint({"record", "--duration", "1", "--out", folder.path("bag")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("nothing was heard"));
  EXPECT_FALSE(fs::exists(folder.path("bag")));
}

}  // namespace
}  // namespace trigpoint
