// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/scenario.hpp"

#include "fault.hpp"
#include "route.hpp"
#include "scenarios.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::simulator {

namespace {

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST(Scenario, loads_every_shipped_file) {
  const std::vector<std::string> names = shipped_scenarios();
  EXPECT_THAT(
      names,
      testing::IsSupersetOf(
          {"campus", "short", "campus_64", "urban", "open_sky", "open_sky_fast", "circle"}));
  for (const std::string& name : names) {
    EXPECT_EQ(load_scenario(name).name, name);
  }
}

TEST(Scenario, knows_files_and_shipped_names_from_other_logs) {
  EXPECT_TRUE(is_scenario("campus"));
  EXPECT_TRUE(is_scenario(std::string(TRIGPOINT_SOURCE_DIR) + "/config/scenarios/short.yaml"));
  EXPECT_FALSE(is_scenario("nowhere"));
  EXPECT_FALSE(is_scenario("drive.bag"));
  EXPECT_THAT(error_of([] { load_scenario("nowhere"); }), testing::HasSubstr("config/scenarios"));
}

TEST(Scenario, refuses_an_unknown_key_of_a_fault_with_its_line) {
  const std::string error = error_of([] {
    small_scenario(
        "faults:\n  - {type: gps_outage, start_s: 5.0, duration_s: 6.0}\n  - {type: gps_bias, "
        "offset_m: [1, 0, 0]}\n");
  });
  EXPECT_THAT(error, testing::HasSubstr("small.yaml:10: faults[1].offset_m is not a known key"));
}

TEST(Scenario, refuses_an_unknown_fault_naming_the_known_ones) {
  const std::string error = error_of([] { small_scenario("faults:\n  - {type: gps_outtage}\n"); });
  EXPECT_THAT(error, testing::HasSubstr("small.yaml:9: faults[0].type must be one of"));
  EXPECT_THAT(error, testing::HasSubstr("gps_outage"));
}

TEST(Scenario, refuses_an_unknown_setting_of_every_fault_with_file_and_line) {
  for (const auto& [name, make] : fault_registry()) {
    const std::string error = error_of(
        [&name = name] { small_scenario("faults:\n  - {type: " + name + ", colour: red}\n"); });
    EXPECT_THAT(error, testing::HasSubstr("small.yaml:9: faults[0].colour is not a known key"))
        << name;
  }
}

TEST(Scenario, refuses_a_corner_that_nobody_can_drive) {
  const std::string error = error_of([] {
    load_scenario_text(
        "route:\n  type: waypoints\n  waypoints:\n    - {east_m: 0.0, north_m: 0.0}\n"
        "    - {east_m: 10.0, north_m: 0.0}\n    - {east_m: 0.0, north_m: 0.1}\n",
        "sharp.yaml");
  });
  EXPECT_THAT(error, testing::HasSubstr("sharp.yaml"));
  EXPECT_THAT(error, testing::HasSubstr("at most 150"));
}

TEST(Scenario, refuses_a_file_without_a_route) {
  EXPECT_THAT(error_of([] { load_scenario_text("name: empty\n", "empty.yaml"); }),
              testing::HasSubstr("empty.yaml"));
}

TEST(Scenario, takes_every_registered_fault_and_route) {
  for (const auto& [name, make] : fault_registry()) {
    EXPECT_EQ(small_scenario("faults:\n  - {type: " + name + "}\n").faults.front()->type, name);
  }
  const Scenario eight = load_scenario_text("route: {type: figure_eight, laps: 2}\n", "eight.yaml");
  EXPECT_GT(eight.route->points().size(), 100U);
}

TEST(Scenario, prints_as_yaml_that_loads_to_the_same) {
  Scenario campus = load_scenario("campus");
  const std::string printed = print_config([&](ConfigFields& fields) { describe(campus, fields); });
  Scenario again = load_scenario_text(printed, "printed.yaml");
  EXPECT_EQ(print_config([&](ConfigFields& fields) { describe(again, fields); }), printed);
}

}  // namespace trigpoint::simulator
