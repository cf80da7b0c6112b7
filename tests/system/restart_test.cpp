// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One drive through bringup/run in which each process is killed once; its long brother is
// kill_table.
#include "kill_drive.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using namespace tests;

constexpr double kGoodGps_m = 0.15;  // issue: RMSE while GPS is good
constexpr double kBegins_s = 8.0;    ///< before fused.tum does: odom, datum and their alignment

TEST(Restart, of_each_process_in_one_drive_leaves_the_others_alone_and_the_session_whole) {
  const TemporaryFolder folder;
  DriveSettings settings;
  settings.scenario = "campus";
  settings.duration_s = 46.0;
  settings.domain = own_domain(30);
  settings.session = folder.path("session");
  // The hang comes after the ten seconds in which the others are watched.
  const DriveResult result = drive(settings,
                                   {{11.0, kMapper, Kind::kKill},
                                    {18.0, kGate, Kind::kKill},
                                    {25.0, kFilter, Kind::kKill},
                                    {36.0, kMapper, Kind::kHang}});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  ASSERT_EQ(result.blows.size(), 4U) << result.output;
  for (const BlowResult& one : result.blows) {
    std::printf(
        "%s: down %.2f s, heard %.2f s after its start; the others silent for %.2f s; "
        "worst error after it %.2f m\n",
        one.blow.process.c_str(),
        one.down_s,
        one.pick_up_s,
        one.others_gap_s,
        one.worst_after_m);
    EXPECT_TRUE(one.restarted) << one.blow.process;
    EXPECT_LT(one.pick_up_s, kPickUp_s) << one.blow.process;
    EXPECT_LT(one.others_gap_s, kOthersGap_s) << one.blow.process;
    EXPECT_LT(one.down_s, down_limit_s(one.blow.kind)) << one.blow.process;
  }
  EXPECT_LT(result.rmse_m, kGoodGps_m);
  EXPECT_GT(result.map_points, 100'000U);
  EXPECT_GE(result.covered_s, least_covered_s(result.truth_s - kBegins_s, result.blows));
  EXPECT_TRUE(missed_scans_are_listed(result))
      << result.scans_played << " played, " << missed_scans(result) << " missed, "
      << result.scans_listed << " listed";
  EXPECT_THAT(result.left_in_shared_memory, IsEmpty());

  EXPECT_THAT(result.output,
              AllOf(HasSubstr("trigpoint_lio_mapper was killed by signal 9"),
                    HasSubstr("trigpoint_fusion_gate was killed by signal 9"),
                    HasSubstr("trigpoint_gps_eskf18 was killed by signal 9"),
                    HasSubstr("trigpoint_lio_mapper has not answered for 0.8 s"),
                    HasSubstr("processes failed 4 times")));
  EXPECT_THAT(read_file(settings.session + "/report.md"),
              AllOf(HasSubstr("## Restarts"), HasSubstr("Scans missed: ")));
  EXPECT_THAT(read_file(settings.session + "/logs/trigpoint_lio_mapper.log"),
              HasSubstr("lio_resumed"));
}

// ---- units of systemd ---------------------------------------------------------------------------

TEST(SystemdUnits, are_taken_by_systemd_without_a_complaint) {
  if (run_command({"systemd-analyze", "--version"}).exit_code != 0) {
    GTEST_SKIP() << "systemd-analyze is not installed: the units are not verified";
  }
  namespace fs = std::filesystem;
  const TemporaryFolder folder;
  std::vector<std::string> command{"systemd-analyze", "verify", "--man=no"};
  for (const auto& entry :
       fs::directory_iterator(std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/systemd")) {
    // Verified with programs that are there.
    std::string text = read_file(entry.path().string());
    const std::string installed = "/opt/trigpoint/bin";
    if (const auto at = text.find(installed); at != std::string::npos) {
      text.replace(at, installed.size(), TRIGPOINT_BIN_DIR);
    }
    std::string name = entry.path().filename().string();
    write_file(folder.path(name), text);
    if (const auto at = name.find('@'); at != std::string::npos) {
      name.insert(at + 1, "eskf18");
      fs::create_symlink(entry.path().filename(), folder.path(name));
    }
    command.push_back(folder.path(name));
  }
  EXPECT_GE(command.size(), 3U + 6U);
  const CommandResult result = run_command(command);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, IsEmpty());
}

}  // namespace
}  // namespace trigpoint
