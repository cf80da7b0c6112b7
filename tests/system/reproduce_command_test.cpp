// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// trigpoint reproduce as a user meets it: simulated drives, and bags like LIO-SAM's.
#include "trigpoint/simulator/simulator.hpp"

#include "ros1_bag.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <csignal>
#include <filesystem>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

constexpr auto kLongest = 300s;   // a few seconds where nothing else runs
constexpr double kGood_m = 0.15;  // a drive of a minute with RTK; a wrong axis is metres off

std::vector<std::string> reproduce(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "reproduce"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

json result_in(const std::string& folder) {
  return json::parse(tests::read_file(folder + "/reproduction.json"));
}

/// A drive of the scenario `short` as LIO-SAM's bags hold theirs: their topics, LiDAR and antenna
/// at the IMU (they tell no lever arm), and the IMU turned in its housing.
void write_bag(const std::string& file,
               const std::string& imu_topic,
               const Eigen::Matrix3d& R_imu_base,
               double duration_s) {
  simulator::Scenario scenario = simulator::load_scenario("short");
  scenario.robot.lidar_position_base_m = Eigen::Vector3d::Zero();
  scenario.robot.lidar_roll_pitch_yaw_base_rad = Eigen::Vector3d::Zero();
  scenario.robot.antenna_position_base_m = Eigen::Vector3d::Zero();
  const auto reader = simulator::open_scenario(scenario, 1, duration_s);
  tests::Ros1Bag bag(file);
  while (const auto entry = reader->next()) {
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      ImuSample turned = *imu;
      turned.gyro_radps = R_imu_base * imu->gyro_radps;
      turned.accel_mps2 = R_imu_base * imu->accel_mps2;
      bag.write(imu_topic, entry->receive_ns, turned);
    } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
      bag.write("/gps/fix", entry->receive_ns, *fix);
    } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement)) {
      bag.write("/points_raw", entry->receive_ns, *cloud);
    }
  }
}

const Eigen::Matrix3d& as_in_park() {
  static const Eigen::Matrix3d R = Eigen::Vector3d(-1.0, 1.0, -1.0).asDiagonal();
  return R;
}

TEST(Reproduce, makes_the_table_of_a_simulated_drive) {
  const TemporaryFolder folder;
  const std::string out = folder.path("r");
  const CommandResult result = run_command(reproduce({"--drives",
                                                      "short",
                                                      "--modes",
                                                      "lio,smooth",
                                                      "--duration",
                                                      "18",
                                                      "--withhold-every",
                                                      "8",
                                                      "--withhold-for",
                                                      "2",
                                                      "--out",
                                                      out}),
                                           kLongest);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, AllOf(HasSubstr("## short"), HasSubstr("Only the first 18 s")));
  const json made = result_in(out);
  EXPECT_TRUE(made["complete"].get<bool>());
  ASSERT_EQ(made["drives"].size(), 1U);
  ASSERT_EQ(made["drives"][0]["modes"].size(), 2U);
  for (const json& mode : made["drives"][0]["modes"]) {
    EXPECT_GT(mode["fixes_withheld"]["samples"].get<int>(), 5) << mode["mode"];
    EXPECT_LT(mode["truth"]["none"]["rmse_xyz_m"].get<double>(), 1.0) << mode["mode"];
  }
  for (const char* file : {"reproduction.html",
                           "reproduction.md",
                           "reproduction.csv",
                           "short/trajectories.png",
                           "short/uncertainty.png",
                           "short/smooth/fused.tum",
                           "short/smooth_withheld/fused.tum"}) {
    EXPECT_TRUE(fs::is_regular_file(out + "/" + file)) << file;
  }
  EXPECT_FALSE(fs::exists(out + "/short/smooth/keyframes.sqlite"));
  const CommandResult again = run_command(reproduce({"--out", out}), kLongest);
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.output, HasSubstr("holds a reproduction already"));
}

TEST(Reproduce, reads_bags_like_lio_sam_s_with_their_presets) {
  const TemporaryFolder folder;
  write_bag(folder.path("park.bag"), "/imu_raw", as_in_park(), 18.0);
  write_bag(folder.path("campus.bag"), "/imu_correct", Eigen::Matrix3d::Identity(), 18.0);
  const std::string out = folder.path("r");
  const CommandResult result = run_command(reproduce({"--no-simulated",
                                                      "--park",
                                                      folder.path("park.bag"),
                                                      "--small-campus",
                                                      folder.path("campus.bag"),
                                                      "--modes",
                                                      "smooth",
                                                      "--withhold-every",
                                                      "8",
                                                      "--withhold-for",
                                                      "2",
                                                      "--out",
                                                      out}),
                                           kLongest);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const json made = result_in(out);
  ASSERT_EQ(made["drives"].size(), 2U);
  EXPECT_EQ(made["drives"][0]["paper"]["dataset"], "Small Campus");
  EXPECT_EQ(made["drives"][1]["paper"]["dataset"], "Park");
  EXPECT_EQ(made["drives"][1]["paper"]["ours_m"], 0.12);
  for (const json& drive : made["drives"]) {
    EXPECT_TRUE(drive["is_paper_data"].get<bool>());
    for (const json& mode : drive["modes"]) {
      EXPECT_TRUE(mode["truth"].is_null());  // a bag has none
      EXPECT_GT(mode["fixes_withheld"]["samples"].get<int>(), 5);
      EXPECT_LT(mode["fixes_withheld"]["none"]["rmse_xyz_m"].get<double>(), kGood_m)
          << drive["drive"] << mode["mode"];
    }
  }
}

TEST(Reproduce, says_before_the_work_what_is_wrong_with_any_drive) {
  const TemporaryFolder folder;
  const std::string out = folder.path("r");
  write_bag(folder.path("campus.bag"), "/imu_correct", Eigen::Matrix3d::Identity(), 1.0);
  const auto refused = [&](std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.end(), {"--out", out});
    const CommandResult result = run_command(reproduce(arguments), kLongest);
    EXPECT_EQ(result.exit_code, 2) << result.output;
    EXPECT_THAT(result.output, HasSubstr(words));
    EXPECT_FALSE(fs::exists(out)) << words;
  };
  refused({"--park", "/no/such/park.bag"}, "/no/such/park.bag");
  tests::write_file(folder.path("letter.bag"), "dear");
  refused({"--park", folder.path("letter.bag")}, "letter.bag");
  refused({"--park", folder.path("campus.bag")}, "imu_raw");  // the other bag's topic
  refused({"--drives", "campus,no_such_drive"}, "no_such_drive");
  refused({"--drives", "short,short"}, "short is named twice");
  refused({"--modes", "lio,sharp"}, "sharp");
  refused({"--modes", "lio,lio"}, "lio is named twice");
  refused({"--withhold-for", "50"}, "--withhold-for");
  refused({"--no-simulated"}, "nothing to drive");
  refused({"--quick", "--duration", "5"}, "--quick");
}

TEST(Reproduce, that_is_interrupted_says_so_and_leaves_an_incomplete_result) {
  const TemporaryFolder folder;
  const std::string out = folder.path("r");
  tests::Command command(reproduce({"--drives", "campus", "--modes", "lio", "--out", out}));
  while (command.running() && !fs::exists(out + "/campus/lio/lio.tum")) {
    std::this_thread::sleep_for(100ms);
  }
  command.signal(SIGINT);
  const CommandResult result = command.wait(kLongest);
  EXPECT_EQ(result.exit_code, 130) << result.output;
  EXPECT_THAT(result.output, HasSubstr("interrupted in campus"));
  const json made = result_in(out);
  EXPECT_FALSE(made["complete"].get<bool>());
  EXPECT_EQ(made["missing"], json({"campus"}));
  EXPECT_THAT(tests::read_file(out + "/reproduction.md"), HasSubstr("INCOMPLETE"));
}

}  // namespace
}  // namespace trigpoint
