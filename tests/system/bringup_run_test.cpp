// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// bringup/run with programs that only seem to be there: what the script itself says.
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using namespace tests;
namespace fs = std::filesystem;

/// `restarts` lines are in restarts.csv when the drive is over.
std::string told_of(int restarts) {
  const TemporaryFolder folder;
  const std::string bin = folder.path("bin");
  const std::string ready = folder.path("ready");
  fs::create_directories(bin);
  fs::create_directories(ready);
  const auto add = [&](const std::string& name, const std::string& body) {
    write_file(bin + "/" + name, "#!/usr/bin/env bash\n" + body);
    fs::permissions(bin + "/" + name, fs::perms::owner_all);
  };
  std::string lines = "unix_s,program,restarted,lived_s,what\\n";
  for (int i = 0; i < restarts; ++i) {
    lines += "1700000000,trigpoint_lio_mapper,1,9.5,killed\\n";
  }
  add("trigpoint",
      "case $1 in\n"
      "  config) printf 'bus:\\n  domain_id: -1\\ngps_odometry:\\n  filter: eskf18\\n' ;;\n"
      "  play) [[ $* == *--check* ]] || until [ $(ls " +
          ready +
          " | wc -l) = 3 ]; do sleep 0.05; done ;;\n"
          "esac\n");
  // Ready when it can be ended and the failures stand in the session.
  add("trigpoint_supervise",
      "trap 'exit 0' TERM\n"
      "while [ \"$1\" != --records ]; do shift; done\n"
      "[ -s \"$2\" ] || printf '" +
          lines + "' >\"$2\"\ntouch " + ready + "/$$\nwhile :; do sleep 0.05; done\n");
  for (const char* name : {"lio_mapper", "fusion_gate", "gps_eskf18"}) {
    add(std::string("trigpoint_") + name, "");
  }
  const CommandResult result = run_command(
      {std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/run", "--no-build", "--out", folder.path("s")},
      60s,
      {{"ROS_DOMAIN_ID", own_domain(54)}, {"TRIGPOINT_BIN", bin}});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  return result.output;
}

TEST(BringupRun, counts_one_failure_in_words_and_more_in_numbers) {
  EXPECT_THAT(told_of(1), HasSubstr("a process failed once during the drive"));
  EXPECT_THAT(told_of(4), HasSubstr("processes failed 4 times during the drive"));
}

}  // namespace
}  // namespace trigpoint
