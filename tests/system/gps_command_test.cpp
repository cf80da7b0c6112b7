// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The trigpoint command where it is about GPS filters and their inputs.
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

CommandResult trigpoint(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), std::string(TRIGPOINT_BIN_DIR) + "/trigpoint");
  return run_command(arguments, 60s, {{"ROS_DOMAIN_ID", tests::own_domain()}});
}

TEST(GpsPlots, make_a_page_of_the_three_filters_and_never_over_another) {
  if (run_command({"gnuplot", "--version"}, 10s, {}).exit_code != 0) {
    GTEST_SKIP() << "gnuplot is not installed: pictures are not tested";
  }
  const TemporaryFolder folder;
  const std::vector<std::string> arguments{"gps-plots",
                                           "--outage-from",
                                           "40",
                                           "--outage",
                                           "5",
                                           "--around",
                                           "5",
                                           "--out",
                                           folder.path("p")};
  const CommandResult result = trigpoint(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr(folder.path("p/index.html")));
  for (const char* file : {"bands.png",
                           "all.png",
                           "plots/bands_ekf15.dat",
                           "plots/bands_eskf18.dat",
                           "plots/bands_ekf15_strict.dat"}) {
    EXPECT_TRUE(fs::exists(folder.path(std::string("p/") + file))) << file;
  }
  const CommandResult again = trigpoint(arguments);
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, HasSubstr("index.html already"));
}

TEST(GpsPlots, name_their_own_options_when_the_drive_would_be_too_long) {
  const TemporaryFolder folder;
  const CommandResult result =
      trigpoint({"gps-plots", "--outage-from", "1e9", "--out", folder.path("p")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("--outage-from, --outage and --around"));
  EXPECT_THAT(result.output, Not(HasSubstr("--duration")));
}

TEST(Map, of_a_scenario_is_refused_where_wheels_are_named) {
  const TemporaryFolder folder;
  std::ofstream(folder.path("wheels.yaml")) << "robot:\n  twist_topic: wheels\n";
  const CommandResult result = trigpoint(
      {"map", "short", "--config", folder.path("wheels.yaml"), "--out", folder.path("s")});
  EXPECT_EQ(result.exit_code, 2) << result.output;
  EXPECT_THAT(result.output, HasSubstr("robot.twist_topic"));
  EXPECT_FALSE(fs::exists(folder.path("s")));
}

/// A power failure leaves files of no bytes; who does not start for them never starts again.
TEST(GpsFilter, starts_and_warns_in_a_session_whose_datum_and_counts_are_damaged) {
  for (const std::string program : {"trigpoint_gps_eskf18", "trigpoint_fusion_gate"}) {
    const TemporaryFolder folder;
    tests::write_file(folder.path("datum.yaml"), "");
    tests::write_file(folder.path("gps_odometry.counts.yaml"), "fix.received: [\n");
    tests::Command running(
        {std::string(TRIGPOINT_BIN_DIR) + "/" + program, "--session", folder.path()},
        {{"ROS_DOMAIN_ID", tests::own_domain()}});
    const auto is_ready = [&] {
      return running.output_so_far().find("ready") != std::string::npos;
    };
    for (int i = 0; i < 300 && running.running() && !is_ready(); ++i) {
      std::this_thread::sleep_for(100ms);
    }
    EXPECT_TRUE(is_ready()) << running.output_so_far();
    running.signal(SIGTERM);
    const CommandResult result = running.wait(30s);
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_THAT(result.output, HasSubstr("datum.yaml"));
  }
}

}  // namespace
}  // namespace trigpoint
