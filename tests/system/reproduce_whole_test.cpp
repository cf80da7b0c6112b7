// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// trigpoint reproduce over whole drives, every mode: what the project claims of itself. Of the
// paper's claims the table tells; they are results here, not requirements.
#include "run_command.hpp"
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <map>

namespace trigpoint {
namespace {

using nlohmann::json;

constexpr auto kLongest = std::chrono::seconds(5400);
constexpr double kGood_m = 0.15;  // RTK all the time but for 20 s on campus

TEST(ReproduceWhole, smooth_is_nowhere_worse_than_lio_and_good_on_campus_and_park) {
  const tests::TemporaryFolder folder;
  const std::string out = folder.path("r");
  const tests::CommandResult result = tests::run_command(
      {std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "reproduce", "--out", out}, kLongest);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const json made = json::parse(tests::read_file(out + "/reproduction.json"));
  ASSERT_EQ(made["drives"].size(), 2U);
  for (const json& drive : made["drives"]) {
    std::map<std::string, json> modes;
    for (const json& mode : drive["modes"]) {
      modes[mode["mode"]] = mode;
    }
    ASSERT_EQ(modes.size(), 5U);
    for (const char* reference : {"fixes_withheld", "truth", "truth_withheld"}) {
      const auto rmse_m = [&](const char* mode) {
        return modes.at(mode)[reference]["none"]["rmse_xyz_m"].get<double>();
      };
      EXPECT_LT(rmse_m("smooth"), kGood_m) << drive["drive"] << reference;
      EXPECT_LT(rmse_m("smooth"), rmse_m("lio")) << drive["drive"] << reference;
    }
  }
}

}  // namespace
}  // namespace trigpoint
