// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The main job as a user runs it: bringup/run over DDS on a short simulated drive, beside the
// offline run of the same drive.
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/export/session.hpp"

#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <memory>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::Command;
using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

constexpr double kGoodGps_m = 0.15;            // issue: RMSE while GPS is good
constexpr double kDdsAgainstOffline_m = 0.05;  // issue: at any stamp
const std::string kScenario = "short";

std::map<std::string, std::string> environment(int offset) {
  return {{"ROS_DOMAIN_ID", tests::own_domain(offset)}, {"TRIGPOINT_BIN", TRIGPOINT_BIN_DIR}};
}

std::string script() {
  return std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/run";
}

std::string program() {
  return std::string(TRIGPOINT_BIN_DIR) + "/trigpoint";
}

std::uint64_t count_of(const std::string& session,
                       const std::string& part,
                       const std::string& name) {
  for (const NamedCount& count : exporter::read_counts(session + "/" + part + ".counts.yaml")) {
    if (count.name == name) {
      return count.count;
    }
  }
  ADD_FAILURE() << part << " counts no " << name;
  return 0;
}

double rmse_against_truth(const std::string& session) {
  const auto fused = exporter::read_trajectory(session + "/fused.tum");
  const auto truth = exporter::read_trajectory(session + "/truth.tum");
  const auto association = evaluation::associate(fused, truth);
  EXPECT_GT(association.coverage.from_first, 0.95);
  return evaluation::absolute_error(association.pairs).position_m.rmse;
}

/// One run of each kind, shared by the tests that look at the results.
class MainJob : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    dds_ = run_command(
        {script(), kScenario, "--no-build", "--out", dds_session()}, 240s, environment(0));
    offline_ = run_command({program(), "map", kScenario, "--out", offline_session()}, 120s);
  }

  static void TearDownTestSuite() { folder_.reset(); }

  static std::string dds_session() { return folder_->path("dds"); }

  static std::string offline_session() { return folder_->path("offline"); }

  static std::unique_ptr<TemporaryFolder> folder_;
  static CommandResult dds_;
  static CommandResult offline_;
};

std::unique_ptr<TemporaryFolder> MainJob::folder_;
CommandResult MainJob::dds_;
CommandResult MainJob::offline_;

TEST_F(MainJob, ends_well_over_dds_and_offline) {
  EXPECT_EQ(dds_.exit_code, 0) << dds_.output;
  EXPECT_EQ(offline_.exit_code, 0) << offline_.output;
}

/// The gate hands back what it follows: that is no other filter.
TEST_F(MainJob, has_a_gps_filter_that_does_not_take_itself_for_another_one) {
  for (const auto& log : fs::directory_iterator(dds_session() + "/logs")) {
    EXPECT_THAT(tests::read_file(log.path().string()), Not(HasSubstr("warm_start"))) << log.path();
  }
}

TEST_F(MainJob, leaves_every_file_of_a_session) {
  for (const char* name : {"map.pcd",
                           "fused.tum",
                           "lio.tum",
                           "gps.tum",
                           "truth.tum",
                           "datum.yaml",
                           "config.yaml",
                           "alignment.yaml",
                           "report.md",
                           "trajectories.png",
                           "uncertainty.png"}) {
    EXPECT_TRUE(fs::exists(dds_session() + "/" + name)) << "dds: " << name;
    EXPECT_TRUE(fs::exists(offline_session() + "/" + name)) << "offline: " << name;
  }
  EXPECT_GT(fs::file_size(dds_session() + "/map.pcd"), 100'000U);
}

TEST_F(MainJob, follows_the_truth_while_gps_is_good_without_any_alignment) {
  EXPECT_LT(rmse_against_truth(dds_session()), kGoodGps_m);
  EXPECT_LT(rmse_against_truth(offline_session()), kGoodGps_m);
}

TEST_F(MainJob, uses_every_message_of_the_log_in_both_runs) {
  for (const std::string& session : {dds_session(), offline_session()}) {
    const std::uint64_t sweeps = count_of(session, "log", "points.in_log");
    EXPECT_GT(sweeps, 100U);
    EXPECT_EQ(count_of(session, "lio_mapper", "points.received"), sweeps) << session;
    EXPECT_EQ(count_of(session, "lio_mapper", "imu.received"),
              count_of(session, "log", "imu.in_log"))
        << session;
    EXPECT_EQ(count_of(session, "gps_odometry", "fix.received"),
              count_of(session, "log", "fix.in_log"))
        << session;
    EXPECT_EQ(exporter::read_scans(session + "/scans.csv").size(),
              count_of(session, "lio_mapper", "points.used"))
        << session;
  }
  EXPECT_EQ(count_of(dds_session(), "lio_mapper", "points.used"),
            count_of(offline_session(), "lio_mapper", "points.used"));
}

TEST_F(MainJob, over_dds_agrees_with_the_offline_run_at_every_stamp) {
  const auto dds = exporter::read_trajectory(dds_session() + "/fused.tum");
  const auto offline = exporter::read_trajectory(offline_session() + "/fused.tum");
  const auto association = evaluation::associate(dds, offline);
  EXPECT_GT(association.coverage.whole, 0.95);
  EXPECT_LT(evaluation::absolute_error(association.pairs).position_m.max, kDdsAgainstOffline_m);
}

TEST(OfflineRun, gives_the_same_bytes_twice) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    const CommandResult result = run_command(
        {program(), "map", kScenario, "--duration", "12", "--out", folder.path(name)}, 120s);
    ASSERT_EQ(result.exit_code, 0) << result.output;
  }
  for (const char* name : {"fused.tum", "lio.tum", "gps.tum", "map.pcd"}) {
    const std::string first = tests::read_file(folder.path("a") + "/" + name);
    EXPECT_FALSE(first.empty()) << name;
    EXPECT_EQ(first, tests::read_file(folder.path("b") + "/" + name)) << name;
  }
}

/// Waits until the session holds at least `lines` scans; false after a minute.
bool wait_for_scans(const std::string& session, std::ptrdiff_t lines) {
  const auto deadline = std::chrono::steady_clock::now() + 60s;
  while (std::chrono::steady_clock::now() < deadline) {
    const std::string scans = tests::read_file(session + "/scans.csv");
    if (std::count(scans.begin(), scans.end(), '\n') > lines) {
      return true;
    }
    std::this_thread::sleep_for(50ms);
  }
  return false;
}

TEST(MainJobStopped, by_the_user_keeps_what_was_done_and_says_so) {
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  Command job({script(), kScenario, "--no-build", "--rate", "1", "--out", session}, environment(1));
  ASSERT_TRUE(wait_for_scans(session, 60)) << job.output_so_far();
  job.signal(SIGINT);
  const CommandResult result = job.wait(60s);
  EXPECT_EQ(result.exit_code, 130) << result.output;
  EXPECT_THAT(result.output, HasSubstr("interrupted"));
  EXPECT_TRUE(fs::exists(session + "/map.pcd")) << result.output;
  EXPECT_THAT(tests::read_file(session + "/report.md"), HasSubstr("interrupted by the user"));
}

TEST(MainJobStopped, before_anything_was_driven_leaves_nothing_in_the_way_of_the_next_run) {
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  Command job({script(), kScenario, "--no-build", "--rate", "1", "--out", session}, environment(4));
  const auto deadline = std::chrono::steady_clock::now() + 60s;
  while (!fs::exists(session + "/config.yaml") && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(2ms);
  }
  ASSERT_TRUE(fs::exists(session + "/config.yaml")) << job.output_so_far();
  job.signal(SIGINT);
  const CommandResult result = job.wait(60s);
  EXPECT_EQ(result.exit_code, 130) << result.output;
  EXPECT_THAT(result.output, HasSubstr("nothing is left of it"));
  EXPECT_FALSE(fs::exists(session));
}

/// Kills each successor of the mapper as soon as it is there, until there is none any more.
void kill_again_and_again(const Command& job, const std::string& session) {
  const auto deadline = std::chrono::steady_clock::now() + 30s;
  const auto given_up = [&] { return job.output_so_far().find("giving up") != std::string::npos; };
  while (!given_up() && std::chrono::steady_clock::now() < deadline) {
    const std::string number = tests::read_file(session + "/logs/trigpoint_lio_mapper.pid");
    if (!number.empty()) {
      kill(static_cast<pid_t>(std::stol(number)), SIGKILL);
    }
    std::this_thread::sleep_for(50ms);
  }
}

TEST(MainJobStopped, by_a_process_that_cannot_be_kept_running_names_it_and_keeps_what_was_done) {
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  Command job({script(), kScenario, "--no-build", "--rate", "1", "--out", session}, environment(2));
  ASSERT_TRUE(wait_for_scans(session, 60)) << job.output_so_far();
  kill_again_and_again(job, session);
  const CommandResult result = job.wait(60s);
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_THAT(result.output, HasSubstr("for the 6th time in quick succession; giving up"));
  EXPECT_THAT(result.output, HasSubstr("trigpoint_lio_mapper ended"));
  EXPECT_TRUE(fs::exists(session + "/map.pcd")) << result.output;
  EXPECT_FALSE(exporter::read_run(session + "/run.yaml").interrupted) << "the player was ended too";
  EXPECT_THAT(tests::read_file(session + "/report.md"),
              AllOf(HasSubstr("Failed"),
                    HasSubstr("sweeps were never answered by the mapper"),
                    Not(HasSubstr("by the user"))));
}

TEST(MainJobStopped, by_its_own_death_leaves_no_process_behind_and_the_domain_free) {
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  Command job({script(), kScenario, "--no-build", "--rate", "1", "--out", session}, environment(3));
  ASSERT_TRUE(wait_for_scans(session, 10)) << job.output_so_far();
  const CommandResult second = run_command(
      {script(), kScenario, "--no-build", "--out", folder.path("b")}, 30s, environment(3));
  EXPECT_EQ(second.exit_code, 1) << second.output;
  EXPECT_THAT(second.output, HasSubstr("DDS domain"));
  EXPECT_FALSE(fs::exists(folder.path("b")));
  job.signal(SIGKILL);
  const auto deadline = std::chrono::steady_clock::now() + 20s;
  const auto anybody = [&] {
    return run_command({"pgrep", "-f", "--", "--session " + session}, 10s).exit_code == 0;
  };
  while (anybody() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(100ms);
  }
  EXPECT_FALSE(anybody());
}

}  // namespace
}  // namespace trigpoint
