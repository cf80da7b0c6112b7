// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// bringup/host keeps its computer's processes running, and bringup/collect lists what failed on
// all.
#include "run_command.hpp"
#include "wait_until.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace tests;

constexpr auto kForever = 30s;

std::string script(const std::string& name) {
  return std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/" + name;
}

template <typename Condition>
bool comes_true(Condition condition) {
  return wait_until(condition, kForever);
}

class HostRestart : public ::testing::Test {
 protected:
  std::unique_ptr<Command> host(const std::vector<std::string>& arguments) const {
    std::vector<std::string> command{script("host")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    command.insert(command.end(), {"--no-build", "--out", part_});
    return std::make_unique<Command>(
        command,
        std::map<std::string, std::string>{{"ROS_DOMAIN_ID", own_domain(31)},
                                           {"TRIGPOINT_BIN", TRIGPOINT_BIN_DIR}});
  }

  std::string log_of(const std::string& program) const {
    const std::string file = part_ + "/logs/" + program + ".log";
    return std::filesystem::exists(file) ? read_file(file) : "";
  }

  int pid_of(const std::string& program) const {
    const std::string file = part_ + "/logs/" + program + ".pid";
    return std::filesystem::exists(file) ? std::atoi(read_file(file).c_str()) : 0;
  }

  /// How often a program has said that it is ready.
  std::ptrdiff_t lives_of(const std::string& program) const {
    const std::string log = log_of(program);
    std::ptrdiff_t lives = 0;
    for (auto at = log.find("ready"); at != std::string::npos; at = log.find("ready", at + 1)) {
      ++lives;
    }
    return lives;
  }

  const TemporaryFolder folder_;
  const std::string part_ = folder_.path("base");
};

TEST_F(HostRestart, of_killed_processes_leaves_the_others_alone_and_is_listed) {
  const auto running = host({"base"});
  const std::vector<std::string> programs{
      "trigpoint_fusion_gate", "trigpoint_gps_eskf18", "trigpoint_clock_watch"};
  for (const std::string& program : programs) {
    ASSERT_TRUE(comes_true([&] { return lives_of(program) == 1; })) << running->output_so_far();
  }
  const int filter = pid_of("trigpoint_gps_eskf18");
  for (const std::string& program : {programs[0], programs[2]}) {
    kill(pid_of(program), SIGKILL);
    ASSERT_TRUE(comes_true([&] { return lives_of(program) == 2; })) << running->output_so_far();
  }
  EXPECT_EQ(kill(filter, 0), 0);
  EXPECT_EQ(pid_of("trigpoint_gps_eskf18"), filter);
  running->signal(SIGTERM);
  const CommandResult result = running->wait(kForever);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("trigpoint_fusion_gate was killed by signal 9"),
                    HasSubstr("processes failed 2 times")));
  EXPECT_FALSE(std::filesystem::exists(part_ + "/logs/trigpoint_fusion_gate.pid"));

  std::filesystem::copy(part_, folder_.path("robot"), std::filesystem::copy_options::recursive);
  write_file(folder_.path("robot/restarts.csv"),
             "unix_s,program,restarted,lived_s,what\n7,trigpoint_lio_mapper,1,5,\"killed\"\n");
  // A report on a part alone is no part of the whole, and the two differ.
  for (const std::string& part : {folder_.path("robot"), part_}) {
    const CommandResult report =
        run_command({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "report", part});
    ASSERT_TRUE(std::filesystem::exists(part + "/report.html")) << report.output;
  }
  const CommandResult collected = run_command(
      {script("collect"), folder_.path("whole"), folder_.path("robot"), part_, "--no-report"});
  EXPECT_EQ(collected.exit_code, 0) << collected.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.path("whole/report.html")));
  const std::string restarts = read_file(folder_.path("whole/restarts.csv"));
  EXPECT_EQ(std::count(restarts.begin(), restarts.end(), '\n'), 1 + 1 + 2) << restarts;
}

TEST_F(HostRestart, of_one_process_is_counted_in_words) {
  const auto running = host({"gate"});
  const std::string program = "trigpoint_fusion_gate";
  ASSERT_TRUE(comes_true([&] { return lives_of(program) == 1; })) << running->output_so_far();
  kill(pid_of(program), SIGKILL);
  ASSERT_TRUE(comes_true([&] { return lives_of(program) == 2; })) << running->output_so_far();
  running->signal(SIGTERM);
  const CommandResult result = running->wait(kForever);
  EXPECT_EQ(result.exit_code, 0) << result.output
                                 << read_file(part_ + "/logs/trigpoint_clock_watch.log");
  EXPECT_THAT(result.output, HasSubstr("bringup/host: a process failed once; see " + part_));
}

/// The report takes what is missing at the end of a run that the user stopped for no loss.
TEST_F(HostRestart, that_is_given_up_is_not_taken_for_the_user_s_stop_of_the_player) {
  const std::vector<std::string> arguments{"mapper,filter,gate", "--play", "short"};
  const std::string program = "trigpoint_fusion_gate";
  const auto plays = [&] {
    const std::string scans = read_file(part_ + "/scans.csv");
    return std::count(scans.begin(), scans.end(), '\n') > 10;
  };
  const auto run_yaml = [&] { return read_file(part_ + "/run.yaml"); };
  {
    const auto running = host(arguments);
    ASSERT_TRUE(comes_true(plays)) << running->output_so_far();
    const auto given_up = [&] {
      if (const int number = pid_of(program); number > 0) {
        kill(number, SIGKILL);
      }
      return running->output_so_far().find("giving up") != std::string::npos;
    };
    ASSERT_TRUE(comes_true(given_up)) << running->output_so_far();
    EXPECT_EQ(running->wait(kForever).exit_code, 1);
    EXPECT_THAT(run_yaml(), AllOf(HasSubstr("log: "), Not(HasSubstr("interrupted"))));
  }
  std::filesystem::remove_all(part_);
  const auto running = host(arguments);
  ASSERT_TRUE(comes_true(plays)) << running->output_so_far();
  running->signal(SIGTERM);
  EXPECT_EQ(running->wait(kForever).exit_code, 0);
  EXPECT_THAT(run_yaml(), HasSubstr("interrupted: true"));
}

TEST_F(HostRestart, does_not_try_again_what_cannot_be) {
  write_file(folder_.path("c.yaml"), "fusion_gate: {no_such_key: 1}\n");
  const auto refused = host({"base", "--config", folder_.path("c.yaml")})->wait(kForever);
  EXPECT_EQ(refused.exit_code, 2) << refused.output;

  const Command first({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_fusion_gate"},
                      {{"ROS_DOMAIN_ID", own_domain(31)}});
  ASSERT_TRUE(comes_true([&] { return first.output_so_far().find("ready") != std::string::npos; }));
  std::this_thread::sleep_for(1s);  // of two that are less than 0.5 s apart either may be the first
  const auto ended = host({"gate"})->wait(kForever);  // there may be one on a domain
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("giving up"));
}

TEST_F(HostRestart, with_a_discovery_server_has_nothing_that_a_kill_leaves_in_shared_memory) {
  if (run_command({"sh", "-c", "command -v fast-discovery-server"}).exit_code != 0) {
    GTEST_SKIP() << "fast-discovery-server (package fastdds-tools) is not installed";
  }
  if (std::string(TRIGPOINT_VENDOR) != "fastdds") {
    GTEST_SKIP() << "Cyclone DDS knows no discovery server, and says so";
  }
  const std::string server = "discovery_server";
  const auto running = host({"gate", "--discovery-server", "127.0.0.1:11877", "--serve-discovery"});
  const auto is_up = [&] { return log_of(server).find("SERVER") != std::string::npos; };
  ASSERT_TRUE(comes_true(is_up)) << running->output_so_far() << log_of(server);
  const int first = pid_of(server);
  EXPECT_THAT(read_file("/proc/" + std::to_string(first) + "/maps"), Not(HasSubstr("/dev/shm")));
  kill(first, SIGKILL);
  ASSERT_TRUE(comes_true([&] { return pid_of(server) != first; })) << running->output_so_far();
  running->signal(SIGTERM);
  running->wait(kForever);
}

TEST_F(HostRestart, is_not_reached_with_security_and_a_discovery_server) {
  write_file(folder_.path("c.yaml"), "bus: {security_folder: somewhere}\n");
  const auto refused =
      host({"base", "--config", folder_.path("c.yaml"), "--discovery-server", "10.0.0.1"})
          ->wait(kForever);
  EXPECT_EQ(refused.exit_code, 2) << refused.output;
  EXPECT_THAT(refused.output, AllOf(HasSubstr("security_folder"), HasSubstr("--peers")));
  EXPECT_FALSE(std::filesystem::exists(part_));
}

}  // namespace
}  // namespace trigpoint
