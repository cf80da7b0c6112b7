// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/geodesy/local_frame.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "entries.hpp"
#include "scenarios.hpp"
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace trigpoint::simulator {

TEST(Stream, is_bit_identical_for_the_same_seed_and_differs_for_another) {
  const Scenario scenario = small_scenario();
  const std::string first = bytes_of(entries_of(scenario, 1, 3.0));
  EXPECT_EQ(first, bytes_of(entries_of(scenario, 1, 3.0)));
  EXPECT_NE(first, bytes_of(entries_of(scenario, 2, 3.0)));
}

TEST(Stream, gives_the_same_imu_and_fixes_without_the_lidar) {
  const Scenario scenario = small_scenario();
  const auto with = entries_of(scenario, 1, 3.0, true);
  const auto without = entries_of(scenario, 1, 3.0, false);
  EXPECT_TRUE(messages_of<PointCloudMessage>(without).empty());
  const auto a = messages_of<ImuSample>(with);
  const auto b = messages_of<ImuSample>(without);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(a.back().gyro_radps, b.back().gyro_radps);
  EXPECT_EQ(messages_of<GnssFix>(with).back().latitude_deg,
            messages_of<GnssFix>(without).back().latitude_deg);
}

TEST(Stream, comes_in_order_of_arrival_with_late_fixes_after_newer_ones) {
  const Scenario scenario = small_scenario("gnss: {late_share: 0.2}\n");
  const auto entries = entries_of(scenario, 1, 20.0, false);
  Nanoseconds arrived_ns = 0;
  Nanoseconds newest_fix_ns = 0;
  int overtaken = 0;
  for (const recording::LogEntry& entry : entries) {
    ASSERT_GE(entry.receive_ns, arrived_ns);
    arrived_ns = entry.receive_ns;
    if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      ASSERT_GT(entry.receive_ns, fix->stamp_ns);
      overtaken += fix->stamp_ns < newest_fix_ns ? 1 : 0;
      newest_fix_ns = std::max(newest_fix_ns, fix->stamp_ns);
    }
  }
  EXPECT_GT(overtaken, 5);
}

TEST(Stream, makes_a_sweep_available_with_its_last_point) {
  const Scenario scenario = small_scenario();
  const auto entries = entries_of(scenario, 1, 2.0);
  int sweeps = 0;
  for (const recording::LogEntry& entry : entries) {
    if (const auto* cloud = std::get_if<PointCloudMessage>(&entry.measurement)) {
      ++sweeps;
      const double delay_s = to_seconds(entry.receive_ns - cloud->stamp_ns);
      EXPECT_GT(delay_s, 0.0999);
      EXPECT_LT(delay_s, 0.11);
    }
  }
  EXPECT_EQ(sweeps, 19);  // the one that would end after the drive is not begun
}

TEST(Stream, delivers_exactly_what_its_summary_says_with_faults_too) {
  const Scenario scenario = small_scenario(
      "faults:\n  - {type: imu_gap, start_s: 1.0, duration_s: 1.0, share: 0.3}\n"
      "  - {type: gps_outage, start_s: 1.0, duration_s: 1.0}\n"
      "  - {type: lidar_drop, start_s: 0.5, duration_s: 2.0, share: 0.5}\n");
  const auto reader = open_scenario(scenario, 1, 3.0);
  const auto entries = all_of(*reader);
  const auto& topics = reader->summary().topics;
  EXPECT_EQ(messages_of<ImuSample>(entries).size(), topics[0].messages);
  EXPECT_EQ(messages_of<GnssFix>(entries).size(), topics[1].messages);
  EXPECT_EQ(messages_of<PointCloudMessage>(entries).size(), topics[2].messages);
  EXPECT_LT(topics[2].messages, 29U);
  EXPECT_GT(topics[2].messages, 9U);
  EXPECT_EQ(reader->summary().format, "scenario");
  EXPECT_EQ(reader->progress(), 1.0);
}

TEST(Stream, has_fixes_about_the_antenna_and_not_about_the_base) {
  const Scenario scenario = small_scenario("robot: {antenna_position_base_m: [-0.5, 0.3, 1.2]}\n");
  const auto reader = open_scenario(scenario, 1, 20.0, {false});
  const geodesy::LocalFrame frame(scenario.datum);
  constexpr double kRtk_m = 0.1;  // five sigma of a fixed solution
  for (const GnssFix& fix : messages_of<GnssFix>(all_of(*reader))) {
    const Pose T_map_base = reader->truth()->at(fix.stamp_ns).T_map_base;
    const Eigen::Vector3d p = *frame.to_map({fix.latitude_deg, fix.longitude_deg, fix.altitude_m});
    EXPECT_LT((p - T_map_base * Eigen::Vector3d(-0.5, 0.3, 1.2)).norm(), kRtk_m);
    EXPECT_GT((p - T_map_base.p).norm(), 1.0);
  }
}

TEST(GpsOutage, silences_the_fixes_of_its_interval_and_no_others) {
  const Scenario scenario =
      small_scenario("faults:\n  - {type: gps_outage, start_s: 5.0, duration_s: 6.0}\n");
  const auto fixes = messages_of<GnssFix>(entries_of(scenario, 1, 20.0, false));
  for (const GnssFix& fix : fixes) {
    const double t_s = seconds(scenario, fix.stamp_ns);
    EXPECT_TRUE(t_s < 5.0 || t_s >= 11.0) << t_s;
  }
  EXPECT_EQ(fixes.size(), 100U - 30U);
}

TEST(GpsOutage, can_say_that_there_is_no_fix_instead_of_being_silent) {
  const Scenario scenario = small_scenario(
      "faults:\n  - {type: gps_outage, start_s: 5.0, duration_s: 6.0, silent: false}\n");
  const auto fixes = messages_of<GnssFix>(entries_of(scenario, 1, 20.0, false));
  EXPECT_EQ(std::count_if(fixes.begin(),
                          fixes.end(),
                          [](const GnssFix& fix) { return fix.status == FixStatus::kNoFix; }),
            30);
}

TEST(GpsBias, moves_the_fixes_by_its_offset_and_leaves_the_covariance) {
  const Scenario clean = small_scenario();
  const Scenario biased = small_scenario(
      "faults:\n  - {type: gps_bias, start_s: 5.0, duration_s: 6.0, offset_enu_m: [1.0, -0.5, "
      "0.2]}\n");
  const auto a = messages_of<GnssFix>(entries_of(clean, 1, 20.0, false));
  const auto b = messages_of<GnssFix>(entries_of(biased, 1, 20.0, false));
  const geodesy::LocalFrame frame(clean.datum);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double t_s = seconds(clean, a[i].stamp_ns);
    const Eigen::Vector3d moved =
        *frame.to_map({b[i].latitude_deg, b[i].longitude_deg, b[i].altitude_m}) -
        *frame.to_map({a[i].latitude_deg, a[i].longitude_deg, a[i].altitude_m});
    const bool active = t_s >= 5.0 && t_s < 11.0;
    EXPECT_LT(
        (moved - (active ? Eigen::Vector3d(1.0, -0.5, 0.2) : Eigen::Vector3d(0, 0, 0))).norm(),
        1e-6);
    EXPECT_EQ(a[i].covariance_enu_m2, b[i].covariance_enu_m2);
  }
}

TEST(GpsNoiseScale, scales_the_error_and_not_the_report) {
  const Scenario clean = small_scenario();
  const Scenario noisy = small_scenario("faults:\n  - {type: gps_noise_scale, factor: 10.0}\n");
  const auto truth = make_truth(clean, 1);
  const geodesy::LocalFrame frame(clean.datum);
  const auto a = messages_of<GnssFix>(entries_of(clean, 1, 20.0, false));
  const auto b = messages_of<GnssFix>(entries_of(noisy, 1, 20.0, false));
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector3d p =
        truth->at(a[i].stamp_ns).T_map_base * clean.robot.antenna_position_base_m;
    const Eigen::Vector3d error_a =
        *frame.to_map({a[i].latitude_deg, a[i].longitude_deg, a[i].altitude_m}) - p;
    const Eigen::Vector3d error_b =
        *frame.to_map({b[i].latitude_deg, b[i].longitude_deg, b[i].altitude_m}) - p;
    ASSERT_LT((error_b - 10.0 * error_a).norm(), 1e-6);
    ASSERT_EQ(a[i].covariance_enu_m2, b[i].covariance_enu_m2);
  }
}

TEST(GpsClass, changes_errors_and_report_together) {
  const Scenario scenario =
      small_scenario("faults:\n  - {type: gps_class, start_s: 5.0, gnss_class: float}\n");
  for (const GnssFix& fix : messages_of<GnssFix>(entries_of(scenario, 1, 20.0, false))) {
    const bool is_float = seconds(scenario, fix.stamp_ns) >= 5.0;
    EXPECT_EQ(fix.status, is_float ? FixStatus::kFix : FixStatus::kGbas);
    EXPECT_NEAR(std::sqrt(fix.covariance_enu_m2(0, 0)), is_float ? 0.3 : 0.014, 1e-9);
  }
}

TEST(LidarDrop, drops_blanks_or_thins_the_sweeps_of_its_interval) {
  const auto sweeps_with = [](const std::string& mode) {
    const Scenario scenario = small_scenario(
        "faults:\n  - {type: lidar_drop, start_s: 1.0, duration_s: 0.5, share: 1.0, mode: " + mode +
        "}\n");
    return messages_of<PointCloudMessage>(entries_of(scenario, 1, 2.0));
  };
  EXPECT_EQ(sweeps_with("drop").size(), 14U);
  const auto blank = sweeps_with("blank");
  EXPECT_EQ(
      std::count_if(blank.begin(), blank.end(), [](const auto& cloud) { return cloud.width == 0; }),
      5);
  EXPECT_EQ(blank.size(), 19U);
}

TEST(ImuGap, swallows_the_samples_of_its_interval) {
  const Scenario scenario =
      small_scenario("faults:\n  - {type: imu_gap, start_s: 1.0, duration_s: 0.5}\n");
  for (const ImuSample& imu : messages_of<ImuSample>(entries_of(scenario, 1, 3.0, false))) {
    const double t_s = seconds(scenario, imu.stamp_ns);
    EXPECT_TRUE(t_s < 1.0 || t_s >= 1.5) << t_s;
  }
}

TEST(Truth, is_written_as_tum_with_its_frame_and_all_digits_of_the_stamps) {
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / "trigpoint_truth_test.tum";
  const auto reader = open_scenario(small_scenario(), 1, 4.0, {false});
  EXPECT_FALSE(reader->truth_file().has_value());
  reader->write_truth(path.string());
  EXPECT_EQ(reader->truth_file(), path.string());
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  EXPECT_NE(line.find("base_link in map"), std::string::npos);
  std::getline(file, line);
  EXPECT_NE(line.find("43.9456"), std::string::npos);
  int rows = 0;
  while (std::getline(file, line)) {
    std::istringstream row(line);
    std::string stamp;
    double x = 0.0;
    row >> stamp >> x;
    EXPECT_EQ(stamp.substr(stamp.find('.') + 1).size(), 9U);
    ++rows;
  }
  EXPECT_EQ(rows, 401);
  std::filesystem::remove(path);
  EXPECT_THROW(reader->write_truth("/nowhere/at/all/truth.tum"), std::runtime_error);
}

}  // namespace trigpoint::simulator
