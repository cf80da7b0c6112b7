// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "input.hpp"

#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "../export/scratch_folder.hpp"
#include "number_checks.hpp"
#include "told_once.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint::cli {
namespace {

using test::error_of;
using test::ScratchFolder;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

InputOptions parse(const std::string& arguments) {
  InputOptions options;
  CLI::App app("test");
  add_input_options(app, options);
  app.parse(arguments);
  return options;
}

InputOptions of(const std::string& log) {
  InputOptions options;
  options.log = log;
  options.duration_s = 0.5;
  return options;
}

TEST(InputArguments, are_a_log_and_what_is_done_with_it) {
  const InputOptions options =
      parse("drive.bag --config a.yaml --config b.yaml --mode lio --seed 7 --duration 2.5");
  EXPECT_EQ(options.log, "drive.bag");
  EXPECT_THAT(options.config_files, ElementsAre("a.yaml", "b.yaml"));
  EXPECT_EQ(options.mode, "lio");
  EXPECT_EQ(options.seed, 7U);
  EXPECT_EQ(options.duration_s, 2.5);
}

TEST(InputArguments, without_a_log_or_with_a_wrong_number_are_a_usage_error) {
  EXPECT_THROW(parse("--seed 7"), CLI::RequiredError);
  EXPECT_THROW(parse("drive.bag --seed seven"), CLI::ValidationError);
  EXPECT_THROW(parse("drive.bag --duration long"), CLI::ParseError);
  for (const char* wrong : {"-3", "0", "nan", "inf", "1e400"}) {
    EXPECT_THROW(parse(std::string("drive.bag --duration ") + wrong), CLI::ValidationError)
        << wrong;
  }
  for (const char* wrong : {"-1", "nan", "inf", "far"}) {
    EXPECT_THROW(parse(std::string("short --start ") + wrong), CLI::ValidationError) << wrong;
  }
  EXPECT_EQ(parse("short --start 0").changes.start_m, 0.0);
  for (const char* wrong : {"-1", "1.5", "1e23", "99999999999999999999"}) {
    EXPECT_THROW(parse(std::string("drive.bag --seed ") + wrong), CLI::ValidationError) << wrong;
  }
  EXPECT_THROW(parse("drive.bag other.bag"), CLI::ExtrasError);
}

TEST(Input, that_does_not_exist_is_named) {
  EXPECT_THAT(error_of([] { open_input(of("/nowhere/drive.bag")); }),
              HasSubstr("/nowhere/drive.bag"));
}

TEST(Input, of_a_scenario_brings_its_robot_its_datum_and_its_truth) {
  const ScratchFolder folder;
  const Input input = open_input(of("short"));
  EXPECT_FALSE(std::filesystem::exists(folder.file("session")));
  leave_truth(input, folder.file("session"));
  const auto scenario = simulator::load_scenario("short");
  EXPECT_EQ(input.config.cores.robot.antenna_position_base_m,
            scenario.robot.antenna_position_base_m);
  EXPECT_TRUE(input.config.cores.gps_odometry.use_configured_datum);
  EXPECT_EQ(input.config.cores.gps_odometry.datum_latitude_deg, scenario.datum.latitude_deg);
  EXPECT_EQ(input.reader->truth_file(), folder.file("session/truth.tum"));
  EXPECT_TRUE(std::filesystem::exists(folder.file("session/truth.tum")));
}

TEST(Input, lets_the_users_files_win_over_what_the_log_knows_and_the_mode_over_the_files) {
  const ScratchFolder folder;
  test::write_all(folder.file("mine.yaml"),
                  "robot: {antenna_position_base_m: [1.0, 2.0, 3.0]}\nfusion_gate: {mode: lio}\n");
  InputOptions options = of("short");
  options.config_files = {folder.file("mine.yaml")};
  const Input input = open_input(options);
  EXPECT_EQ(input.config.cores.robot.antenna_position_base_m, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(input.config.cores.robot.lidar_position_base_m,
            simulator::load_scenario("short").robot.lidar_position_base_m);
  EXPECT_EQ(input.config.cores.fusion_gate.mode, "lio");
  EXPECT_EQ(input.config.log.duration_s, 0.5);
  options.mode = "fusion";
  EXPECT_EQ(load_config_of(options).cores.fusion_gate.mode, "fusion");
}

TEST(Input, refuses_a_mode_that_there_is_not) {
  InputOptions options = of("short");
  options.mode = "gentle";
  EXPECT_THAT(error_of([&] { load_config_of(options); }),
              AllOf(HasSubstr("--mode"), HasSubstr("gentle"), HasSubstr("hard")));
}

TEST(UsedFolder, is_refused_and_an_empty_or_new_one_is_not) {
  const ScratchFolder folder;
  EXPECT_EQ(error_of([&] { refuse_used_folder(folder.path()); }), "");
  EXPECT_EQ(error_of([&] { refuse_used_folder(folder.file("new")); }), "");
  test::write_all(folder.file("datum.yaml"), "");
  EXPECT_THAT(error_of([&] { refuse_used_folder(folder.path()); }), HasSubstr("datum.yaml"));
  EXPECT_THAT(error_of([&] { refuse_used_folder(folder.file("datum.yaml")); }),
              HasSubstr("no folder"));
}

TEST(ToldOnce, hands_on_the_first_of_each_kind_and_counts_the_others) {
  std::vector<std::string> told;
  ToldOnce events([&told](const Event& event) { told.push_back(event.text); });
  for (const char* text : {"a", "b", "c"}) {
    events({Severity::kWarning, 0, "same", text});
    events({Severity::kInfo, 0, "news", text});
  }
  events({Severity::kError, 0, "alone", "d"});
  EXPECT_THAT(told, ElementsAre("a", "a", "b", "c", "d"));
  EXPECT_EQ(events.summary(), "  same: 2 more like this\n");
}

TEST(Rate, is_max_or_a_number_above_zero) {
  EXPECT_EQ(rate_of("max"), 0.0);
  EXPECT_EQ(rate_of("2.5"), 2.5);
  for (const char* wrong : {"0", "-1", "nan", "inf", "abc", "1x", ""}) {
    EXPECT_THROW(rate_of(wrong), ConfigError) << wrong;
  }
}

TEST(Input, takes_a_simulated_drives_folder_or_the_log_within_it) {
  const ScratchFolder folder;
  const auto scenario = simulator::load_scenario("short");
  simulator::simulate(scenario, 1, 0.5, folder.path());
  for (const std::string& path :
       {folder.path(), folder.file("log"), folder.file("log/"), folder.file("log/log_0.db3")}) {
    const Input input = open_input(of(path));
    EXPECT_EQ(input.config.cores.robot.antenna_position_base_m,
              scenario.robot.antenna_position_base_m)
        << path;
    EXPECT_EQ(input.reader->truth_file(), folder.file("truth.tum")) << path;
    EXPECT_TRUE(input.reader->next()) << path;
  }
}

TEST(Input, that_lacks_a_topic_is_refused_unless_it_may) {
  const ScratchFolder folder;
  simulator::simulate(simulator::load_scenario("short"),
                      1,
                      0.5,
                      folder.path(),
                      {},
                      simulator::StreamOptions{false});
  InputOptions options = of(folder.path());
  EXPECT_THAT(error_of([&] { open_input(options); }), HasSubstr("points"));
  options.lenient = true;
  EXPECT_EQ(error_of([&] { open_input(options); }), "");
}

TEST(Input, of_a_topic_that_the_user_named_wrongly_is_a_matter_of_configuration) {
  const ScratchFolder folder;
  simulator::simulate(simulator::load_scenario("short"), 1, 0.5, folder.file("drive"));
  for (const std::string& topic : {std::string("lidar"), std::string("imu/data")}) {
    test::write_all(folder.file("mine.yaml"), "robot: {points_topic: " + topic + "}\n");
    InputOptions options = of(folder.file("drive"));
    options.config_files = {folder.file("mine.yaml")};
    try {
      open_input(options);
      FAIL() << topic << " was accepted";
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr(topic), HasSubstr("robot.points_topic")));
    }
  }
}

TEST(Input, of_a_scenario_that_ends_with_a_plus_lacks_its_change) {
  EXPECT_THAT(error_of([] { open_input(of("short+")); }), HasSubstr("short+: ends with +"));
}

}  // namespace
}  // namespace trigpoint::cli
