// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"

#include "as_ros1_messages.hpp"
#include "samples.hpp"
#include "temporary_folder.hpp"
#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include <fstream>

// nav_msgs/Odometry, which has no Debian package of its own here, of ROS 1's own parts.
struct RosOdometry {
  std_msgs::Header header;
  std::string child_frame_id;
  geometry_msgs::PoseWithCovariance pose;
  geometry_msgs::TwistWithCovariance twist;
};

namespace ros {
namespace message_traits {
template <>
struct MD5Sum<RosOdometry> {
  static const char* value() { return "cd5e73d190d741a2f92e81eda573aca7"; }

  static const char* value(const RosOdometry&) { return value(); }
};

template <>
struct DataType<RosOdometry> {
  static const char* value() { return "nav_msgs/Odometry"; }

  static const char* value(const RosOdometry&) { return value(); }
};

template <>
struct Definition<RosOdometry> {
  static const char* value() { return ""; }

  static const char* value(const RosOdometry&) { return value(); }
};
}  // namespace message_traits

namespace serialization {
template <>
struct Serializer<RosOdometry> {
  template <typename Stream, typename Message>
  static void allInOne(Stream& stream, Message message) {
    stream.next(message.header);
    stream.next(message.child_frame_id);
    stream.next(message.pose);
    stream.next(message.twist);
  }

  ROS_DECLARE_ALLINONE_SERIALIZER
};
}  // namespace serialization
}  // namespace ros

namespace trigpoint::recording {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using tests::ros_cloud;
using tests::ros_fix;
using tests::ros_imu;
using tests::ros_time;

geometry_msgs::TwistWithCovariance ros_twist(const TwistMeasurement& twist) {
  geometry_msgs::TwistWithCovariance message;
  message.twist.linear.x = twist.linear_mps.x();
  message.twist.linear.y = twist.linear_mps.y();
  message.twist.linear.z = twist.linear_mps.z();
  message.twist.angular.z = 77.0;
  for (std::size_t i = 0; i < 36; ++i) {
    message.covariance[i] = -1.0;
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      message.covariance[static_cast<std::size_t>(6 * row + column)] =
          twist.covariance_m2ps2(row, column);
    }
  }
  return message;
}

/// Two seconds, as a ROS 1 recorder writes them, in chunks of about 20 kB.
fs::path record(const fs::path& file, rosbag::CompressionType compression) {
  constexpr std::uint32_t kChunk_bytes = 20'000;
  rosbag::Bag bag(file.string(), rosbag::bagmode::Write);
  bag.setCompression(compression);
  bag.setChunkThreshold(kChunk_bytes);
  for (int i = 0; i < 200; ++i) {
    bag.write("/imu/data", ros_time(sample_imu(i).stamp_ns), ros_imu(sample_imu(i)));
    if (i % 10 == 0) {
      bag.write("/gps/fix", ros_time(sample_fix(i / 10).stamp_ns), ros_fix(sample_fix(i / 10)));
      bag.write(
          "/points", ros_time(sample_cloud(i / 10).stamp_ns), ros_cloud(sample_cloud(i / 10)));
    }
  }
  bag.close();
  return file;
}

void expect_the_samples(const std::vector<LogEntry>& entries,
                        std::size_t imu_at_least,
                        std::size_t clouds_at_least) {
  const auto imu = only<ImuSample>(entries);
  ASSERT_GE(imu.size(), imu_at_least);
  for (std::size_t i = 0; i < imu.size(); ++i) {
    const auto expected = sample_imu(static_cast<int>(i));
    ASSERT_EQ(expected.stamp_ns, imu[i].stamp_ns);
    ASSERT_EQ(expected.gyro_radps, imu[i].gyro_radps);
    ASSERT_EQ(expected.accel_mps2, imu[i].accel_mps2);
    ASSERT_TRUE(imu[i].q_world_base && imu[i].q_world_base->isApprox(*expected.q_world_base));
  }
  const auto fixes = only<GnssFix>(entries);
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    ASSERT_EQ(sample_fix(static_cast<int>(i)).latitude_deg, fixes[i].latitude_deg);
    ASSERT_EQ(sample_fix(static_cast<int>(i)).covariance_enu_m2, fixes[i].covariance_enu_m2);
    ASSERT_EQ(FixStatus::kGbas, fixes[i].status);
    ASSERT_EQ(CovarianceType::kKnown, fixes[i].covariance_type);
  }
  const auto clouds = only<PointCloudMessage>(entries);
  ASSERT_GE(clouds.size(), clouds_at_least);
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    ASSERT_EQ(sample_cloud(static_cast<int>(i)).data, clouds[i].data);
    ASSERT_EQ("time", clouds[i].fields.at(3).name);
    ASSERT_EQ(16U, clouds[i].point_step);
  }
}

class Rosbag1 : public testing::TestWithParam<rosbag::CompressionType> {
 protected:
  TemporaryFolder folder_;
};

TEST_P(Rosbag1, decodes_twists_odometries_and_headings_that_ros_wrote) {
  const fs::path file = folder_ / "aided.bag";
  {
    rosbag::Bag bag(file.string(), rosbag::bagmode::Write);
    bag.setCompression(GetParam());
    for (int i = 0; i < 10; ++i) {
      const TwistMeasurement twist = sample_twist(i);
      geometry_msgs::TwistWithCovarianceStamped wheels;
      wheels.header.stamp = ros_time(twist.stamp_ns);
      wheels.header.frame_id = twist.frame_id;
      wheels.twist = ros_twist(twist);
      bag.write("/wheels", ros_time(twist.stamp_ns), wheels);
      RosOdometry odometry;
      odometry.header = wheels.header;
      odometry.header.frame_id = "odom";
      odometry.child_frame_id = twist.frame_id;
      odometry.pose.pose.position.x = 100.0;
      odometry.pose.pose.orientation.w = 1.0;
      odometry.twist = wheels.twist;
      bag.write("/odom", ros_time(twist.stamp_ns), odometry);
      const YawMeasurement yaw = sample_yaw(i);
      ImuSample sample = sample_imu(i);
      sample.q_world_base = yaw.q_world_base;
      sensor_msgs::Imu compass = ros_imu(sample);
      compass.header.stamp = ros_time(yaw.stamp_ns);
      compass.header.frame_id = yaw.frame_id;
      compass.orientation_covariance[8] = yaw.variance_rad2;
      bag.write("/compass", ros_time(yaw.stamp_ns), compass);
    }
  }
  LogOptions options;
  options.require_points = options.require_imu = options.require_fix = false;
  RobotConfig robot;
  robot.yaw_topic = "compass";
  for (const std::string message : {"TwistWithCovarianceStamped", "Odometry"}) {
    robot.twist_message = message;
    robot.twist_topic = message == "Odometry" ? "odom" : "wheels";
    const auto entries = read_all(*open_log(file.string(), robot, options));
    const auto twists = only<TwistMeasurement>(entries);
    ASSERT_EQ(10U, twists.size()) << message;
    expect_equal(sample_twist(3), twists[3]);
    const auto yaws = only<YawMeasurement>(entries);
    ASSERT_EQ(10U, yaws.size());
    expect_equal(sample_yaw(4), yaws[4]);
  }
}

TEST_P(Rosbag1, decodes_what_ros_wrote) {
  const auto log = open_log(record(folder_ / "drive.bag", GetParam()).string(), RobotConfig{});
  EXPECT_EQ("rosbag1", log->summary().format);
  EXPECT_EQ(kStart_ns, log->summary().first_ns);
  const auto entries = read_all(*log);
  EXPECT_EQ(240U, entries.size());
  expect_the_samples(entries, 200, 20);
}

TEST_P(Rosbag1, a_truncated_bag_delivers_what_came_before_then_says_so) {
  const auto file = record(folder_ / "drive.bag", GetParam());
  // Without the index at the end, and a part of the last chunk.
  fs::resize_file(file, fs::file_size(file) * 2 / 3);
  const auto log = open_log(file.string(), RobotConfig{});
  std::vector<LogEntry> entries;
  const auto told = message_of<LogError>([&] {
    while (auto entry = log->next()) {
      entries.push_back(*entry);
    }
  });
  EXPECT_THAT(told, AllOf(HasSubstr("breaks off after"), HasSubstr("drive.bag")));
  EXPECT_THAT(log->summary().faults, testing::ElementsAre(HasSubstr("breaks off after")));
  EXPECT_LT(entries.size(), 240U);
  expect_the_samples(entries, 50, 5);
}

INSTANTIATE_TEST_SUITE_P(Compressions,
                         Rosbag1,
                         testing::Values(rosbag::compression::Uncompressed,
                                         rosbag::compression::BZ2,
                                         rosbag::compression::LZ4),
                         [](const auto& param) {
                           return param.param == rosbag::compression::Uncompressed ? "none"
                                  : param.param == rosbag::compression::BZ2        ? "bz2"
                                                                                   : "lz4";
                         });

TEST(Rosbag1Cut, says_that_a_bag_is_cut_in_its_header) {
  TemporaryFolder folder;
  const auto file = record(folder / "drive.bag", rosbag::compression::Uncompressed);
  for (const std::uintmax_t bytes : {100U, 20U, 8U}) {
    fs::resize_file(file, bytes);
    EXPECT_THAT(
        message_of<LogError>([&] { open_log(file.string(), RobotConfig{}); }),
        AllOf(
            HasSubstr("drive.bag"), HasSubstr("cut off in its"), HasSubstr(std::to_string(bytes))));
  }
}

TEST(Rosbag1Cut, is_recognised_without_its_extension) {
  TemporaryFolder folder;
  const auto file = record(folder / "drive", rosbag::compression::Uncompressed);
  EXPECT_EQ(240U, read_all(*open_log(file.string(), RobotConfig{})).size());
}

TEST(Rosbag1Real, needs_points_unless_told_otherwise) {
  const std::string file = std::string(TRIGPOINT_SHARED_DATA) + "/robot_localization/test1.bag";
  if (!fs::exists(file)) {
    GTEST_SKIP() << "needs the recorded bag " << file;
  }
  RobotConfig robot;
  robot.fix_topic = "fix";
  EXPECT_THAT(message_of<LogError>([&] { open_log(file, robot); }),
              AllOf(HasSubstr("'points'"),
                    HasSubstr("no topic of type sensor_msgs/msg/PointCloud2"),
                    HasSubstr("/imu/data")));
  LogOptions options;
  options.require_points = false;
  const auto entries = read_all(*open_log(file, robot, options));
  const auto fixes = only<GnssFix>(entries);
  EXPECT_EQ(989U, fixes.size()) << "as the data's README counts them";
  double force_mps2 = 0.0;
  const auto imu = only<ImuSample>(entries);
  for (const auto& sample : imu) {
    force_mps2 += sample.accel_mps2.norm() / static_cast<double>(imu.size());
  }
  EXPECT_NEAR(9.8, force_mps2, 0.3) << "gravity is in the specific force";
  EXPECT_NEAR(395.0, to_seconds(entries.back().receive_ns - entries.front().receive_ns), 2.0);
}

TEST(Rosbag1Real, refuses_a_file_that_is_no_bag) {
  TemporaryFolder folder;
  std::ofstream(folder / "not.bag") << "this is not a bag, but it is named like one";
  EXPECT_THAT(message_of<LogError>([&] { open_log((folder / "not.bag").string(), RobotConfig{}); }),
              AllOf(HasSubstr("not.bag"), HasSubstr("ROSBAG V2.0")));
}

}  // namespace
}  // namespace trigpoint::recording
