// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP as a user of the trigpoint command meets it.
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::CommandResult;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

std::string program() {
  return std::string(TRIGPOINT_BIN_DIR) + "/trigpoint";
}

CommandResult trigpoint(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program());
  return tests::run_command(arguments, 90s, {{"ROS_DOMAIN_ID", tests::own_domain()}});
}

/// Simulates the same drive into `storage` and maps it.
void map_drive(const TemporaryFolder& folder, const std::string& storage) {
  const std::string drive = folder.path(storage);
  const CommandResult simulated =
      trigpoint({"simulate", "short", "--duration", "8", "--storage", storage, "--out", drive});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.output;
  const CommandResult mapped =
      trigpoint({"map", drive, "--out", folder.path(storage + "_session")});
  ASSERT_EQ(mapped.exit_code, 0) << mapped.output;
}

TEST(McapCommand, a_drive_gives_the_same_map_and_trajectories_from_mcap_as_from_sqlite3) {
  const TemporaryFolder folder;
  map_drive(folder, "sqlite3");
  map_drive(folder, "mcap");
  EXPECT_TRUE(fs::exists(folder.path("mcap/log/log_0.mcap")));
  for (const char* name : {"lio.tum", "gps.tum", "fused.tum", "fused_smoothed.tum", "map.pcd"}) {
    const std::string file = std::string("_session/") + name;
    const std::string expected = tests::read_file(folder.path("sqlite3" + file));
    EXPECT_GT(expected.size(), 1000U) << name;
    EXPECT_TRUE(tests::read_file(folder.path("mcap" + file)) == expected) << name;
  }
}

TEST(McapCommand, record_hears_what_play_says_into_one_file) {
  const TemporaryFolder folder;
  const std::string file = folder.path("drive.mcap");
  const std::map<std::string, std::string> environment{{"ROS_DOMAIN_ID", tests::own_domain(50)}};
  tests::Command recorder({program(), "record", "--out", file, "--duration", "12"}, environment);
  const CommandResult played = tests::run_command(
      {program(), "play", "short", "--duration", "3", "--rate", "1", "--wait", "3"},
      60s,
      environment);
  EXPECT_EQ(played.exit_code, 0) << played.output;
  const CommandResult recorded = recorder.wait(60s);
  EXPECT_EQ(recorded.exit_code, 0) << recorded.output;
  const CommandResult info = trigpoint({"info", file});
  EXPECT_EQ(info.exit_code, 0) << info.output;
  EXPECT_THAT(info.output,
              AllOf(HasSubstr("format    mcap"),
                    HasSubstr("/imu/data"),
                    HasSubstr("/points"),
                    HasSubstr("/gps/fix")));
}

TEST(McapCommand, a_recording_that_was_killed_is_mapped_up_to_its_break_which_is_told) {
  const TemporaryFolder folder;
  tests::Command simulation(
      {program(), "simulate", "short", "--storage", "mcap", "--out", folder.path("drive")});
  const fs::path file = folder.path("drive/log/log_0.mcap");
  std::error_code none;
  constexpr std::uintmax_t kSomeSeconds_bytes = 25U << 20U;
  while (simulation.running() &&
         !(fs::exists(file) && fs::file_size(file, none) > kSomeSeconds_bytes)) {
    std::this_thread::sleep_for(10ms);
  }
  ASSERT_TRUE(simulation.running()) << "it was not killed in the middle";
  simulation.signal(SIGKILL);
  simulation.wait(10s);
  const CommandResult info = trigpoint({"info", folder.path("drive/log")});
  EXPECT_EQ(info.exit_code, 1);
  EXPECT_THAT(info.output, AllOf(HasSubstr("log_0.mcap"), HasSubstr("recorder was killed")));
  const CommandResult mapped =
      trigpoint({"map", folder.path("drive"), "--out", folder.path("session")});
  EXPECT_THAT(mapped.output, HasSubstr("recorder was killed"));
  EXPECT_GT(tests::read_file(folder.path("session/lio.tum")).size(), 1000U);
}

TEST(McapCommand, wrong_names_of_what_is_to_be_written_are_usage_errors) {
  const TemporaryFolder folder;
  const std::string file = folder.path("drive.mcap");
  EXPECT_EQ(trigpoint({"record", "--storage", "tape", "--out", folder.path("b")}).exit_code, 2);
  const CommandResult both = trigpoint({"record", "--storage", "sqlite3", "--out", file});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.output, HasSubstr("names an MCAP file"));
  tests::write_file(file, "mine");
  const CommandResult over = trigpoint({"record", "--out", file, "--duration", "1"});
  EXPECT_EQ(over.exit_code, 2);
  EXPECT_THAT(over.output, HasSubstr("exists"));
  EXPECT_EQ(tests::read_file(file), "mine");
}

TEST(McapCommand, a_recording_of_silence_leaves_no_file) {
  const TemporaryFolder folder;
  const std::string file = folder.path("drive.mcap");
  EXPECT_EQ(trigpoint({"record", "--duration", "1", "--out", file}).exit_code, 1);
  EXPECT_FALSE(fs::exists(file));
}

}  // namespace
}  // namespace trigpoint
