// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a session that is resumed on another day says of both.
#include "trigpoint/export/session.hpp"

#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::CommandResult;
using tests::TemporaryFolder;

CommandResult map_short(std::vector<std::string> arguments) {
  arguments.insert(
      arguments.begin(),
      {std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "map", "short", "--duration", "8"});
  return tests::run_command(arguments, 120s);
}

TEST(TwoDays, of_a_session_are_both_in_its_truth_its_logs_and_its_report) {
  const TemporaryFolder folder;
  const std::string session = folder.path("s");
  ASSERT_EQ(map_short({"--out", session}).exit_code, 0);
  const auto day_one = exporter::read_trajectory(session + "/truth.tum");
  const CommandResult resumed = map_short({"--day", "1", "--resume", session});
  ASSERT_EQ(resumed.exit_code, 0) << resumed.output;

  const auto truth = exporter::read_trajectory(session + "/truth.tum");
  EXPECT_EQ(truth.front().stamp_ns, day_one.front().stamp_ns);
  EXPECT_EQ(truth.size(), 2 * day_one.size());
  const auto runs = exporter::runs_in(session);
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[0].log, "short");
  EXPECT_EQ(runs[1].log, "short+day=1");
  EXPECT_EQ(exporter::read_sweeps(session + "/sweeps.csv").size(),
            exporter::read_trajectory(session + "/lio.tum").size());
  EXPECT_THAT(resumed.output,
              AllOf(HasSubstr("`short`, 8.0 s"),
                    HasSubstr("`short+day=1`, 8.0 s"),
                    Not(HasSubstr("holds nothing of the run")),
                    Not(HasSubstr("Scans missed"))));
  // The same drive twice: the way back between them was not driven.
  const auto lio = exporter::read_trajectory(session + "/lio.tum");
  double way_m = 0.0;
  for (std::size_t i = 1; i < lio.size(); ++i) {
    way_m += lio[i].stamp_ns < runs[1].begin_ns || lio[i - 1].stamp_ns >= runs[1].begin_ns
                 ? (lio[i].pose.p - lio[i - 1].pose.p).norm()
                 : 0.0;
  }
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "Distance driven (lio.tum): %.1f m", way_m);
  EXPECT_THAT(resumed.output, HasSubstr(text.data()));
}

}  // namespace
}  // namespace trigpoint
