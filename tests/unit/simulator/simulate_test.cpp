// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "scenarios.hpp"
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace trigpoint::simulator {

namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, gone afterwards.
class Simulate : public testing::Test {
 protected:
  void SetUp() override {
    const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = fs::temp_directory_path() / ("trigpoint_simulate_" + name);
    fs::remove_all(folder_);
  }

  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

void expect_same(const recording::LogEntry& made, const recording::LogEntry& read) {
  ASSERT_EQ(made.measurement.index(), read.measurement.index());
  EXPECT_EQ(made.receive_ns, read.receive_ns);
  if (const auto* imu = std::get_if<ImuSample>(&made.measurement)) {
    EXPECT_EQ(imu->stamp_ns, std::get<ImuSample>(read.measurement).stamp_ns);
    EXPECT_EQ(imu->gyro_radps, std::get<ImuSample>(read.measurement).gyro_radps);
    EXPECT_EQ(imu->accel_mps2, std::get<ImuSample>(read.measurement).accel_mps2);
  } else if (const auto* fix = std::get_if<GnssFix>(&made.measurement)) {
    EXPECT_EQ(fix->latitude_deg, std::get<GnssFix>(read.measurement).latitude_deg);
    EXPECT_EQ(fix->covariance_enu_m2, std::get<GnssFix>(read.measurement).covariance_enu_m2);
    EXPECT_EQ(fix->status, std::get<GnssFix>(read.measurement).status);
  } else {
    EXPECT_EQ(std::get<PointCloudMessage>(made.measurement).data,
              std::get<PointCloudMessage>(read.measurement).data);
  }
}

}  // namespace

TEST_F(Simulate, writes_a_log_that_reads_back_as_the_stream_bit_by_bit) {
  const Scenario scenario = small_scenario("robot: {antenna_position_base_m: [0.0, 0.1, 1.0]}\n");
  double last_progress = 0.0;
  simulate(scenario, 4, 2.0, folder_.string(), [&](double share) { last_progress = share; });
  EXPECT_NEAR(last_progress, 1.0, 0.1);
  const auto log = recording::open_log((folder_ / "log").string(), scenario.robot);
  const auto stream = open_scenario(scenario, 4, 2.0);
  int entries = 0;
  while (const auto made = stream->next()) {
    const auto read = log->next();
    ASSERT_TRUE(read.has_value());
    expect_same(*made, *read);
    ++entries;
  }
  EXPECT_FALSE(log->next().has_value());
  EXPECT_GT(entries, 400);
}

TEST_F(Simulate, keeps_the_scenario_the_robot_and_the_truth_beside_the_log) {
  const Scenario scenario = small_scenario("robot: {antenna_position_base_m: [0.0, 0.1, 1.0]}\n");
  simulate(scenario, 4, 1.0, folder_.string(), {}, {false});
  EXPECT_TRUE(fs::exists(folder_ / "truth.tum"));
  EXPECT_EQ(load_scenario((folder_ / "scenario.yaml").string()).duration_s, scenario.duration_s);
  RobotConfig robot;
  load_config({(folder_ / "robot.yaml").string()}, [&](ConfigFields& fields) {
    fields.section("robot", "", [&](ConfigFields& below) { describe(robot, below); });
  });
  EXPECT_EQ(robot.antenna_position_base_m, scenario.robot.antenna_position_base_m);
}

TEST_F(Simulate, refuses_to_mix_two_drives_in_one_folder) {
  const Scenario scenario = small_scenario();
  simulate(scenario, 4, 1.0, folder_.string(), {}, {false});
  const auto size = fs::file_size(folder_ / "truth.tum");
  EXPECT_THROW(simulate(scenario, 5, 2.0, folder_.string(), {}, {false}), recording::LogError);
  EXPECT_EQ(fs::file_size(folder_ / "truth.tum"), size);
}

TEST_F(Simulate, says_which_folder_cannot_be_made) {
  std::ofstream(folder_.string()) << "a file where the folder should be";
  try {
    simulate(small_scenario(), 1, 1.0, folder_.string(), {}, {false});
    FAIL() << "it was made";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(folder_.string()), std::string::npos);
  }
}

}  // namespace trigpoint::simulator
