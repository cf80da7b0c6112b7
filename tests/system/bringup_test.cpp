// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// bringup/run and bringup/host at their door: mistakes are found before a process is started and a
// session is made.
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

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

std::string script(const std::string& name) {
  return std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/" + name;
}

struct Mistake {
  std::vector<std::string> arguments;
  std::string said;
  std::string domain{tests::own_domain(53)};
};

void expect_refused(const std::string& name, const std::vector<Mistake>& mistakes) {
  const TemporaryFolder folder;
  const std::string session = folder.path("s");
  for (const Mistake& mistake : mistakes) {
    std::vector<std::string> arguments{script(name)};
    arguments.insert(arguments.end(), mistake.arguments.begin(), mistake.arguments.end());
    arguments.insert(arguments.end(), {"--no-build", "--out", session});
    const CommandResult result = run_command(
        arguments, 60s, {{"ROS_DOMAIN_ID", mistake.domain}, {"TRIGPOINT_BIN", TRIGPOINT_BIN_DIR}});
    EXPECT_EQ(result.exit_code, 2) << mistake.said << ": " << result.output;
    EXPECT_THAT(result.output, HasSubstr(mistake.said));
    EXPECT_FALSE(fs::exists(session)) << mistake.said;
    fs::remove_all(session);
  }
}

TEST(Bringup, run_finds_wrong_usage_before_it_makes_a_session) {
  const TemporaryFolder folder;
  const std::string no_interface = folder.path("c.yaml");
  tests::write_file(no_interface, "bus: {network_interface: nope0}\n");
  expect_refused("run",
                 {{{"short", "--rate", "abc"}, "--rate must be 'max' or a number above 0"},
                  {{"short", "--rate", "nan"}, "--rate must be"},
                  {{"short", "--rate", "--seed", "1"}, "--rate needs a value"},
                  {{"short", "--mode", "soft"}, "--mode: 'soft' is neither smooth"},
                  {{"short", "--seed", "1.5"}, "must be a whole number"},
                  {{"short", "--duration", "abc"}, "must be a number above 0"},
                  {{"short", "--config", no_interface}, "network_interface is 'nope0'"},
                  {{"short", "--config", folder.path()}, "is a folder; a YAML file is expected"},
                  {{"short", "--config", "/no/such.yaml"}, "no such file: /no/such.yaml"},
                  {{""}, "LOG is empty"},
                  {{"nosuch"}, "nosuch: no such file or folder, nor a scenario"},
                  {{"short"}, "environment variable ROS_DOMAIN_ID is 'abc'; expected", "abc"}});
}

TEST(Bringup, host_finds_wrong_usage_before_it_makes_a_session) {
  const TemporaryFolder folder;
  const std::string no_interface = folder.path("c.yaml");
  tests::write_file(no_interface, "bus: {network_interface: nope0}\n");
  expect_refused("host",
                 {{{"base", "--play", "short", "--rate", "abc"}, "--rate must be 'max' or"},
                  {{"base", "--play", "short", "--rate", "-1"}, "--rate must be 'max' or"},
                  {{"base", "--play", "short", "--rate", "--for"}, "--rate needs a value"},
                  {{"base", "--rate", "2"}, "--rate is that of --play LOG, which is not there"},
                  {{"base", "--play", "nosuch"}, "nosuch: no such file or folder"},
                  {{"base", "--config", no_interface}, "network_interface is 'nope0'"},
                  {{"base", "--config", folder.path()}, "is a folder; a YAML file is expected"},
                  {{"base", "--peers", "10.0.0.1,x"}, "bus.initial_peers has 'x'"},
                  {{"base", "--vendor", "foo"}, "'foo' is neither fastdds nor cyclonedds"},
                  {{"base", "--name", "a/b"}, "'a/b' becomes part of file names"},
                  {{"mapper,mapper"}, "'mapper' is twice in the list"},
                  {{"robots"}, "'robots' is neither robot, base"},
                  {{"base"}, "environment variable ROS_DOMAIN_ID is 'abc'; expected", "abc"}});
}

TEST(Bringup, names_a_program_that_is_not_built_before_it_makes_a_session) {
  const TemporaryFolder folder;
  for (const char* name : {"trigpoint", "trigpoint_supervise"}) {
    fs::create_directories(folder.path("bin"));
    fs::create_symlink(std::string(TRIGPOINT_BIN_DIR) + "/" + name,
                       folder.path("bin") + "/" + name);
  }
  const std::vector<std::pair<std::vector<std::string>, std::string>> scripts{
      {{"run", "short"}, "trigpoint_lio_mapper"}, {{"host", "robot"}, "trigpoint_clock_watch"}};
  for (const auto& [arguments, missing] : scripts) {
    std::vector<std::string> command{std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/" + arguments[0],
                                     arguments[1],
                                     "--no-build",
                                     "--out",
                                     folder.path("s")};
    const CommandResult result = run_command(
        command,
        60s,
        {{"ROS_DOMAIN_ID", tests::own_domain(53)}, {"TRIGPOINT_BIN", folder.path("bin")}});
    EXPECT_EQ(result.exit_code, 1) << result.output;
    EXPECT_THAT(
        result.output,
        AllOf(HasSubstr(missing + " is not there"), HasSubstr("bringup/build trigpoint_job")));
    EXPECT_FALSE(fs::exists(folder.path("s")));
  }
}

/// As a fresh clone, with a build that only says what it is asked for.
void clone_scripts(const TemporaryFolder& folder) {
  fs::create_directories(folder.path("bringup"));
  for (const char* name : {"run", "host", "common.sh"}) {
    fs::copy_file(script(name), folder.path("bringup") + "/" + name);
  }
  fs::create_directory_symlink(script("profiles"), folder.path("bringup/profiles"));
  fs::create_directories(folder.path("config"));
  fs::create_directory_symlink(std::string(TRIGPOINT_SOURCE_DIR) + "/config/scenarios",
                               folder.path("config/scenarios"));
  const std::string build = folder.path("bringup/build");
  tests::write_file(build, "#!/bin/sh\necho built: \"$@\"\nexit 1\n");
  fs::permissions(build, fs::perms{0755});
}

TEST(Bringup, run_and_host_find_what_they_can_before_they_build) {
  const TemporaryFolder folder;
  clone_scripts(folder);
  fs::create_directories(folder.path("used"));
  tests::write_file(folder.path("used/file"), "");
  const std::vector<std::pair<std::vector<std::string>, std::string>> mistakes{
      {{"run", "short", "--rate", "abc"}, "--rate must be 'max' or a number above 0"},
      {{"run", "short", "--rate", "0.0"}, "--rate must be 'max' or a number above 0"},
      {{"run", "short", "--seed", "1.5"}, "--seed must be a whole number"},
      {{"run", "short", "--beams", "17"}, "--beams must be 16, 32 or 64; is '17'"},
      {{"run", "short", "--beams", "0x10"}, "--beams must be 16, 32 or 64"},
      {{"run", "short", "--duration", "-1"}, "--duration must be a number above 0"},
      {{"run", "short", "--start", "x"}, "--start must be a number of 0 or more"},
      {{"run", "short", "--nonsense"}, "unknown argument '--nonsense'"},
      {{"run", "nosuch"},
       "nosuch: no such file or folder, nor a scenario; scenarios are: campus, "},
      {{"run", "nosuch+wheel_odometry"}, "nosuch+wheel_odometry: no such file or folder"},
      {{"run", "short", "--out", folder.path("used")}, "is not empty"},
      {{"host", "base", "--play", "short", "--rate", "abc"}, "--rate must be 'max' or"},
      {{"host", "base", "--play", "nosuch"}, "nosuch: no such file or folder"},
      {{"host", "base", "--for", "nosuch"}, "nosuch: no such file or folder"},
      {{"host", "base", "--out", folder.path("used")}, "is not empty"}};
  for (const auto& [arguments, said] : mistakes) {
    std::vector<std::string> command = arguments;
    command.front() = folder.path("bringup") + "/" + arguments.front();
    const CommandResult result = run_command(command);
    EXPECT_EQ(result.exit_code, 2) << said << ": " << result.output;
    EXPECT_THAT(result.output,
                AllOf(HasSubstr("bringup/" + arguments.front() + ": "),
                      HasSubstr(said),
                      Not(HasSubstr("built"))));
  }
  for (const char* log : {"short", "short+street_traffic", "short+motion.start_m=5"}) {
    const CommandResult good =
        run_command({folder.path("bringup/run"), log, "--rate", "1.5e0", "--start", "2.5"});
    EXPECT_THAT(good.output, HasSubstr("built: trigpoint_job\n")) << log;
  }
}

CommandResult run_after_build(const TemporaryFolder& folder,
                              const std::string& build,
                              std::vector<std::string> arguments) {
  tests::write_file(folder.path("bringup/build"), "#!/bin/sh\n" + build + "\n");
  arguments.front() = folder.path("bringup") + "/" + arguments.front();
  return run_command(
      arguments,
      60s,
      {{"ROS_DOMAIN_ID", tests::own_domain(53)}, {"TRIGPOINT_BIN", TRIGPOINT_BIN_DIR}});
}

/// A build takes minutes, in which another one may begin.
TEST(Bringup, run_and_host_refuse_a_folder_that_another_one_took_while_they_built) {
  const TemporaryFolder folder;
  clone_scripts(folder);
  const std::string session = folder.path("s");
  for (const auto& [name, argument] : {std::pair{"run", "short"}, std::pair{"host", "base"}}) {
    const CommandResult result = run_after_build(
        folder, "mkdir -p " + session + "/logs", {name, argument, "--out", session});
    EXPECT_EQ(result.exit_code, 2) << result.output;
    EXPECT_THAT(result.output, HasSubstr("has taken '" + session + "'"));
    EXPECT_FALSE(fs::exists(session + "/config.yaml")) << name;
    fs::remove_all(session);
  }
}

TEST(Bringup, host_names_its_part_after_the_time_at_which_it_begins) {
  const TemporaryFolder folder;
  clone_scripts(folder);
  tests::write_file(folder.path("sessions"), "no folder: the name is told, and nothing begins\n");
  const CommandResult result = run_after_build(
      folder, "sleep 1.1; echo built at $(date +%Y%m%d-%H%M%S); sleep 1.1", {"host", "base"});
  EXPECT_EQ(result.exit_code, 1) << result.output;
  const auto stamp_after = [&](const std::string& words) {
    const auto at = result.output.rfind(words);
    return at == std::string::npos ? "" : result.output.substr(at + words.size(), 15);
  };
  EXPECT_GT(stamp_after("cannot make the session folder '" + folder.path("sessions") + "/"),
            stamp_after("built at "))
      << result.output;
}

/// So that who has built for one can run the other with --no-build.
TEST(Bringup, run_and_host_build_the_same) {
  const TemporaryFolder folder;
  clone_scripts(folder);
  for (const auto& [name, argument] : {std::pair{"run", "short"}, std::pair{"host", "base"}}) {
    const CommandResult result =
        run_command({folder.path("bringup") + "/" + name, argument, "--out", folder.path("s")});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.output, HasSubstr("built: trigpoint_job\n"));
    EXPECT_FALSE(fs::exists(folder.path("s")));
  }
}

}  // namespace
}  // namespace trigpoint
