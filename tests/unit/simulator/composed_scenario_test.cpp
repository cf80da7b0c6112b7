// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Scenarios that build on others, changes behind a plus, and other days.
#include "trigpoint/simulator/simulator.hpp"

#include "entries.hpp"
#include "fault.hpp"
#include "places.hpp"
#include "scenarios.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kRounding_m = 1e-6;

std::string error_of(const std::string& name) {
  try {
    load_scenario(name);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "no error";
}

double heading_rad(const TrueState& state) {
  const Eigen::Vector3d x = state.T_map_base.q * Eigen::Vector3d::UnitX();
  return std::atan2(x.y(), x.x());
}

}  // namespace

TEST(ComposedScenario, takes_every_shipped_change) {
  const std::vector<std::string> names = shipped_overlays();
  EXPECT_THAT(names, testing::IsSupersetOf({"beams_64", "wrong_fix", "second_day", "reversed"}));
  for (const std::string& name : names) {
    EXPECT_EQ(load_scenario("campus_twice+" + name).name, "campus_twice+" + name);
  }
}

TEST(ComposedScenario, changes_single_keys_and_adds_faults_up) {
  const Scenario scenario = load_scenario("campus+wrong_fix+motion.start_m=12.5+lidar_lost_scans");
  EXPECT_EQ(scenario.motion.start_m, 12.5);
  EXPECT_EQ(scenario.motion.rest_s, load_scenario("campus").motion.rest_s);
  ASSERT_EQ(scenario.faults.size(), 4U);
  EXPECT_EQ(scenario.faults[0]->type, "gps_outage");
  EXPECT_EQ(scenario.faults[3]->type, "lidar_drop");
}

TEST(ComposedScenario, keeps_a_text_that_loads_to_the_same_drive) {
  const Scenario scenario = load_scenario("campus_32+wrong_fix+second_day");
  const Scenario again = load_scenario_text(scenario.source_yaml, "again.yaml");
  EXPECT_EQ(bytes_of(entries_of(scenario, 1, 0.5)), bytes_of(entries_of(again, 1, 0.5)));
}

TEST(ComposedScenario, refuses_what_it_does_not_know_and_names_the_changes) {
  EXPECT_THAT(error_of("campus+beams_17"), testing::HasSubstr("beams_16"));
  EXPECT_THAT(error_of("campus+motion.start=3"), testing::HasSubstr("start_m"));
  EXPECT_THAT(error_of("campus+motion.start_m=9000"), testing::HasSubstr("nothing would be left"));
  EXPECT_THAT(error_of("nowhere+beams_16"), testing::HasSubstr("nowhere"));
}

TEST(ComposedScenario, has_what_its_base_has) {
  const Scenario base = load_scenario("campus");
  const Scenario scenario = load_scenario("campus_32");
  EXPECT_EQ(scenario.world.halls.size(), base.world.halls.size());
  EXPECT_EQ(scenario.faults.size(), base.faults.size());
  EXPECT_EQ(scenario.duration_s, base.duration_s);
}

TEST(AnotherDay, sees_the_same_world_with_other_noise_and_other_stamps) {
  const Scenario first = load_scenario("campus_twice");
  const Scenario second = load_scenario("campus_twice+second_day");
  EXPECT_EQ(second.start_ns() - first.start_ns(), 86'400 * kNanosecondsPerSecond);
  const Place a(first);
  const Place b(second);
  ASSERT_EQ(a.world.shapes().size(), b.world.shapes().size());
  int hits = 0;
  look_around(a, a.scanner_m(100.0), [&](const Ray& ray, const Hit& hit) {
    ++hits;
    // The ground is sampled on the same lattice of metres wherever the drive begins.
    ASSERT_NEAR(b.world.cast(ray, 100.0).range_m, hit.range_m, kRounding_m);
  });
  EXPECT_GT(hits, 1000);
  const auto imu_a = messages_of<ImuSample>(entries_of(first, 1, 1.0, false));
  const auto imu_b = messages_of<ImuSample>(entries_of(second, 1, 1.0, false));
  EXPECT_NE(imu_a.front().gyro_radps, imu_b.front().gyro_radps);
}

TEST(AnotherDay, starts_where_it_was_asked_to) {
  const auto whole = make_truth(load_scenario("campus_twice"), 1);
  const auto late = make_truth(load_scenario("campus_twice+motion.start_m=150"), 1);
  const Eigen::Vector3d start = late->at(late->first_ns()).T_map_base.p;
  EXPECT_NEAR(start.x(), 150.0, 0.01);
  EXPECT_NEAR(start.y(), 0.0, 0.01);
  double nearest_m = 1e9;
  for (Nanoseconds ns = whole->first_ns(); ns < whole->last_ns(); ns += 10'000'000) {
    nearest_m = std::min(nearest_m, (whole->at(ns).T_map_base.p - start).norm());
  }
  EXPECT_LT(nearest_m, 0.05);
}

TEST(Reversed, begins_at_the_end_of_the_route_the_other_way_round) {
  const auto there = make_truth(load_scenario("campus_twice"), 1);
  const auto back = make_truth(load_scenario("campus_twice+reversed"), 1);
  const TrueState end = there->at(there->last_ns());
  const TrueState begin = back->at(back->first_ns());
  EXPECT_LT((end.T_map_base.p - begin.T_map_base.p).norm(), 0.2);
  EXPECT_NEAR(std::cos(heading_rad(end) - heading_rad(begin)), -1.0, 1e-3);
}

TEST(Routes, are_as_long_as_their_scenarios_say_and_end_within_their_time) {
  const std::pair<const char*, double> lengths[] = {
      {"campus_twice", 1300.0}, {"long_drive", 2500.0}, {"park", 520.0}};
  for (const auto& [name, length_m] : lengths) {
    const Scenario scenario = load_scenario(name);
    EXPECT_NEAR(Path(scenario.route->points()).length_m(), length_m, 0.05 * length_m) << name;
    const auto truth = make_truth(scenario, 1);
    EXPECT_LT(truth->at(truth->last_ns()).v_map_mps.norm(), 0.01) << name;
    EXPECT_GT(truth->at(truth->last_ns() - from_seconds(15.0)).v_map_mps.norm(), 0.3) << name;
  }
}

}  // namespace trigpoint::simulator
