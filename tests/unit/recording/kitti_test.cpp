// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"

#include "kitti_drive.hpp"
#include "samples.hpp"
#include "temporary_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>

namespace trigpoint::recording {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kSweep_s = 0.1;

TEST(KittiPointTime, runs_clockwise_from_the_rear) {
  const float a = 1e-3F;
  EXPECT_NEAR(0.0, kitti_point_time_s(-10.0F, a, kSweep_s), 1e-4) << "just left of the rear";
  EXPECT_NEAR(0.25 * kSweep_s, kitti_point_time_s(0.0F, 5.0F, kSweep_s), 1e-6) << "left";
  EXPECT_NEAR(0.50 * kSweep_s, kitti_point_time_s(5.0F, 0.0F, kSweep_s), 1e-6) << "ahead";
  EXPECT_NEAR(0.75 * kSweep_s, kitti_point_time_s(0.0F, -5.0F, kSweep_s), 1e-6) << "right";
  EXPECT_NEAR(kSweep_s, kitti_point_time_s(-10.0F, -a, kSweep_s), 1e-4) << "just right of the rear";
}

TEST(KittiStamp, keeps_nanoseconds) {
  // 2011-09-26 00:00:00 is day 15243 of 1970.
  EXPECT_EQ(15243LL * 86400 * kNanosecondsPerSecond + 47304 * kNanosecondsPerSecond + 905593646,
            parse_kitti_stamp("2011-09-26 13:08:24.905593646"));
  EXPECT_EQ(500'000'000, parse_kitti_stamp("1970-01-01 00:00:00.5"));
  EXPECT_FALSE(parse_kitti_stamp("2011-13-26 13:08:24.9"));
  EXPECT_FALSE(parse_kitti_stamp("yesterday"));
}

/// A drive of three sweeps, of which the middle one's .bin is missing, and OXTS alone.
class SmallDrive {
 public:
  SmallDrive() : sync_(folder_ / "2011_09_26_drive_0001_sync") {
    fs::create_directories(sync_ / "velodyne_points/data");
    fs::create_directories(sync_ / "oxts/data");
    write("velodyne_points/timestamps_start.txt",
          "2011-09-26 13:00:01.000000000\n2011-09-26 13:00:01.100000000\n2011-09-26 "
          "13:00:01.200000000\n");
    write("velodyne_points/timestamps_end.txt",
          "2011-09-26 13:00:01.100000000\n2011-09-26 13:00:01.200000000\n2011-09-26 "
          "13:00:01.300000000\n");
    const std::vector<float> point{5.0F, 0.0F, 1.0F, 0.5F};
    for (const char* name : {"0000000000.bin", "0000000002.bin"}) {
      std::ofstream(sync_ / "velodyne_points/data" / name, std::ios::binary)
          .write(reinterpret_cast<const char*>(point.data()), sizeof(float) * 4);
    }
    write("oxts/timestamps.txt", "2011-09-26 13:00:00.950000000\n2011-09-26 13:00:01.050000000\n");
    write("oxts/data/0000000000.txt", record(4));
    write("oxts/data/0000000001.txt", record(2));
  }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(sync_ / name) << text;
  }

  std::string path() const { return folder_.path().string(); }

  const fs::path& sync() const { return sync_; }

 private:
  /// Field i holds i, but latitude, longitude and the position mode.
  static std::string record(int position_mode) {
    std::string text = "49.01 8.44";
    for (int i = 2; i < 30; ++i) {
      text += " " + std::to_string(i == 27 ? position_mode : i);
    }
    return text + "\n";
  }

  TemporaryFolder folder_;
  fs::path sync_;
};

TEST(KittiDrive, takes_only_sweeps_whose_points_are_there) {
  SmallDrive drive;
  const auto entries = read_all(*open_log(drive.path(), RobotConfig{}));
  const auto clouds = only<PointCloudMessage>(entries);
  ASSERT_EQ(2U, clouds.size());
  EXPECT_EQ(200 * kMillisecond_ns, clouds[1].stamp_ns - clouds[0].stamp_ns);
}

TEST(KittiDrive, is_refused_where_wheels_or_a_heading_are_wanted_unless_told_otherwise) {
  SmallDrive drive;
  RobotConfig robot;
  robot.yaw_topic = "heading";
  EXPECT_THROW(open_log(drive.path(), robot), LogError);
  LogOptions lenient;
  lenient.require_aiding = false;
  EXPECT_NO_THROW(open_log(drive.path(), robot, lenient));
}

TEST(KittiDrive, turns_beams_upwards_when_their_elevation_is_known_to_be_too_low) {
  SmallDrive drive;
  LogOptions options;
  options.elevation_correction_rad = 0.01;
  const auto clouds = only<PointCloudMessage>(read_all(*open_log(drive.path(), {}, options)));
  float raised[3];
  std::memcpy(raised, clouds.at(0).data.data(), sizeof(raised));
  // The point (5, 0, 1): its range and azimuth stay, its elevation grows.
  constexpr double kRounding = 1e-6;
  EXPECT_NEAR(std::hypot(5.0, 1.0), std::hypot(raised[0], raised[2]), kRounding);
  EXPECT_NEAR(std::atan2(1.0, 5.0) + 0.01, std::atan2(raised[2], raised[0]), kRounding);
  EXPECT_EQ(0.0F, raised[1]);
}

TEST(KittiDrive, reads_the_right_fields_of_the_oxts) {
  SmallDrive drive;
  const auto entries = read_all(*open_log(drive.path(), RobotConfig{}));
  const auto imu = only<ImuSample>(entries);
  ASSERT_EQ(2U, imu.size());
  EXPECT_EQ(Eigen::Vector3d(11, 12, 13), imu[0].accel_mps2);
  EXPECT_EQ(Eigen::Vector3d(17, 18, 19), imu[0].gyro_radps);
  EXPECT_FALSE(imu[0].q_world_base)
      << "the INS's attitude holds GNSS: feeding it would be cheating";
  const auto fixes = only<GnssFix>(entries);
  EXPECT_EQ(49.01, fixes[0].latitude_deg);
  EXPECT_EQ(2.0, fixes[0].altitude_m);
  EXPECT_EQ(FixStatus::kGbas, fixes[0].status);
  EXPECT_EQ(FixStatus::kNoFix, fixes[1].status) << "position mode 2 is dead reckoning";
  // pos_accuracy (here 23) is the root of the sum of both axes' squares.
  EXPECT_NEAR(23.0 * 23.0 / 2.0, fixes[0].covariance_enu_m2(0, 0), 1e-9);
}

TEST(KittiDrive, names_file_and_line_of_what_is_damaged) {
  SmallDrive drive;
  drive.write("oxts/data/0000000001.txt", "49.0 8.4 x 1 2 3\n");
  EXPECT_THAT(message_of<LogError>([&] { open_log(drive.path(), RobotConfig{}); }),
              AllOf(HasSubstr("0000000001.txt:1"), HasSubstr("'x 1 2 3'")));
  drive.write("velodyne_points/timestamps_end.txt", "2011-09-26 13:00:01.1\nnonsense\n");
  EXPECT_THAT(message_of<LogError>([&] { open_log(drive.path(), RobotConfig{}); }),
              HasSubstr("timestamps_end.txt:2"));
}

TEST(KittiDrive, a_truncated_sweep_is_skipped_and_counted) {
  SmallDrive drive;
  fs::resize_file(drive.sync() / "velodyne_points/data/0000000000.bin", 10);
  const auto log = open_log(drive.path(), RobotConfig{});
  EXPECT_EQ(1U, only<PointCloudMessage>(read_all(*log)).size()) << "the later one";
  const Events events = log->take_events();
  ASSERT_EQ(1U, events.size());
  EXPECT_THAT(events[0].text, AllOf(HasSubstr("0000000000.bin"), HasSubstr("truncated")));
  ASSERT_EQ(1U, log->undecodable().size());
  EXPECT_EQ("points", log->undecodable()[0].input);
  EXPECT_EQ(1U, log->undecodable()[0].count);
}

TEST(KittiDrive, says_what_is_assumed_where_the_calibration_is_missing) {
  SmallDrive drive;
  RobotConfig robot;
  robot.lidar_position_base_m = {0.25, 0.0, 1.5};
  EXPECT_THAT(open_log(drive.path(), robot)->summary().faults,
              testing::ElementsAre(AllOf(HasSubstr("calib_imu_to_velo.txt is missing"),
                                         HasSubstr("[0.25, 0, 1.5]"))));
  drive.write("calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n");
  EXPECT_TRUE(open_log(drive.path(), robot)->summary().faults.empty());
}

class RealKitti : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kPath)) {
      GTEST_SKIP() << "needs the recorded drive " << kPath;
    }
  }

  static inline const std::string kPath =
      std::string(TRIGPOINT_SHARED_DATA) + "/kitti_2011_09_26_drive_0009";
};

std::vector<float> floats_of(const PointCloudMessage& cloud) {
  std::vector<float> values(cloud.data.size() / sizeof(float));
  std::memcpy(values.data(), cloud.data.data(), cloud.data.size());
  return values;
}

TEST_F(RealKitti, has_51_sweeps_with_times_within_each) {
  const auto log = open_log(kPath, RobotConfig{});
  int sweeps = 0;
  Nanoseconds last_end_ns = 0;
  while (const auto entry = log->next()) {
    const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement);
    if (cloud == nullptr) {
      continue;
    }
    ++sweeps;
    EXPECT_GT(cloud->width, 100'000U);
    EXPECT_GE(cloud->stamp_ns, last_end_ns) << "a sweep begins when the one before has ended";
    last_end_ns = entry->receive_ns;
    const auto duration_s = static_cast<float>(to_seconds(entry->receive_ns - cloud->stamp_ns));
    EXPECT_NEAR(0.1034, duration_s, 0.001);
    const auto values = floats_of(*cloud);
    float first = 1.0F;
    float last = 0.0F;
    for (std::size_t i = 4; i < values.size(); i += 5) {
      first = std::min(first, values[i]);
      last = std::max(last, values[i]);
    }
    EXPECT_GE(first, 0.0F);
    EXPECT_LT(first, 0.001F) << "points at the cut";
    EXPECT_LE(last, duration_s);
    EXPECT_GT(last, duration_s - 0.001F);
  }
  EXPECT_EQ(51, sweeps);
}

TEST_F(RealKitti, arrives_in_order_with_imu_at_100_hz_and_a_fix_a_sweep) {
  const auto entries = read_all(*open_log(kPath, RobotConfig{}));
  EXPECT_TRUE(
      std::is_sorted(entries.begin(), entries.end(), [](const LogEntry& a, const LogEntry& b) {
        return a.receive_ns < b.receive_ns;
      }));
  const auto imu = only<ImuSample>(entries);
  const auto fixes = only<GnssFix>(entries);
  const auto clouds = only<PointCloudMessage>(entries);
  EXPECT_NEAR(
      100.0,
      static_cast<double>(imu.size() - 1) / to_seconds(imu.back().stamp_ns - imu.front().stamp_ns),
      1.0);
  EXPECT_NEAR(static_cast<double>(clouds.size()), static_cast<double>(fixes.size()), 3.0)
      << "KITTI keeps one OXTS record a sweep, at 9.7 Hz";
  EXPECT_LT(imu.front().stamp_ns, clouds.front().stamp_ns)
      << "filters start before the first sweep";
  EXPECT_GT(imu.back().stamp_ns, clouds.back().stamp_ns + 103 * kMillisecond_ns)
      << "the last sweep is covered";
  EXPECT_LT(to_seconds(entries.back().receive_ns - entries.front().receive_ns), 7.0)
      << "only the span with sweeps";
  double force_mps2 = 0.0;
  for (const auto& sample : imu) {
    force_mps2 += sample.accel_mps2.z() / static_cast<double>(imu.size());
  }
  EXPECT_NEAR(9.8, force_mps2, 0.2);
  EXPECT_NEAR(49.0100, fixes.front().latitude_deg, 1e-3);
}

TEST_F(RealKitti, the_folder_of_the_drive_and_of_its_sync_data_are_the_same_log) {
  const auto outer = open_log(kPath, RobotConfig{});
  const auto inner = open_log(kPath + "/2011_09_26_drive_0009_sync", RobotConfig{});
  EXPECT_EQ(outer->summary().path, inner->summary().path);
  EXPECT_EQ(outer->summary().topics[1].messages, inner->summary().topics[1].messages);
  ASSERT_TRUE(inner->robot());
}

TEST_F(RealKitti, knows_where_the_lidar_sits) {
  const auto robot = open_log(kPath, RobotConfig{})->robot();
  ASSERT_TRUE(robot);
  // The published drawing of the car: 0.81 m ahead of the IMU, 0.32 m to its right, 0.80 m above.
  constexpr double kDrawing_m = 0.03;
  EXPECT_NEAR(0.81, robot->lidar_position_base_m.x(), kDrawing_m);
  EXPECT_NEAR(-0.32, robot->lidar_position_base_m.y(), kDrawing_m);
  EXPECT_NEAR(0.80, robot->lidar_position_base_m.z(), kDrawing_m);
  EXPECT_LT(robot->lidar_roll_pitch_yaw_base_rad.norm(), 0.02);
  EXPECT_EQ(Eigen::Vector3d::Zero(), robot->antenna_position_base_m);
}

}  // namespace
}  // namespace trigpoint::recording
