// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/recording/log.hpp"
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "samples.hpp"
#include "temporary_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace trigpoint::recording {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class OpenLog : public testing::Test {
 protected:
  /// Ten seconds of IMU at 100 Hz, fixes and clouds at 10 Hz, on LIO-SAM's topics.
  std::string recorded() {
    const auto path = (folder_ / "log").string();
    Rosbag2Writer writer(path);
    for (int i = 0; i < 1000; ++i) {
      writer.write("imu_raw", sample_imu(i).stamp_ns, sample_imu(i));
      if (i % 10 == 0) {
        writer.write("gps/fix", sample_fix(i / 10).stamp_ns, sample_fix(i / 10));
        writer.write("points_raw", sample_cloud(i / 10).stamp_ns, sample_cloud(i / 10, 1));
      }
    }
    return path;
  }

  static RobotConfig robot() {
    RobotConfig robot;
    robot.points_topic = "/points_raw";
    robot.imu_topic = "imu_raw";
    return robot;
  }

  std::string refusal(const std::string& path, const RobotConfig& robot) {
    return message_of<LogError>([&] { open_log(path, robot); });
  }

  TemporaryFolder folder_;
};

TEST_F(OpenLog, maps_topics_with_and_without_a_leading_slash) {
  const auto entries = read_all(*open_log(recorded(), robot()));
  EXPECT_EQ(1000U, only<ImuSample>(entries).size());
  EXPECT_EQ(100U, only<GnssFix>(entries).size());
  EXPECT_EQ(100U, only<PointCloudMessage>(entries).size());
}

TEST_F(OpenLog, names_an_unknown_topic_the_nearest_one_and_all_there_are) {
  auto wrong = robot();
  wrong.imu_topic = "imu_row";
  EXPECT_THAT(refusal(recorded(), wrong),
              AllOf(HasSubstr("'imu_row'"),
                    HasSubstr("robot.imu_topic"),
                    HasSubstr("did you mean '/imu_raw'?"),
                    HasSubstr("/points_raw (sensor_msgs/msg/PointCloud2, 100)")));
}

TEST_F(OpenLog, refuses_messages_that_were_all_received_at_the_same_moment) {
  const auto path = (folder_ / "log").string();
  {
    Rosbag2Writer writer(path);
    for (int i = 0; i < 3; ++i) {
      writer.write("imu_raw", 0, sample_imu(i));
      writer.write("gps/fix", 0, sample_fix(i));
      writer.write("points_raw", 0, sample_cloud(i));
    }
  }
  EXPECT_THAT(refusal(path, robot()),
              AllOf(HasSubstr(path + ": all 9 messages are stored as received at 0.0"),
                    HasSubstr("Write it anew")));
}

TEST_F(OpenLog, tells_that_some_messages_have_no_time_of_receiving) {
  const auto path = (folder_ / "log").string();
  {
    Rosbag2Writer writer(path);
    writer.write("gps/fix", 0, sample_fix(0));
    writer.write("imu_raw", kStart_ns, sample_imu(0));
    writer.write("points_raw", kStart_ns, sample_cloud(0));
  }
  EXPECT_THAT(open_log(path, robot())->summary().faults,
              testing::ElementsAre(HasSubstr("received at 0 s, others later")));
}

TEST_F(OpenLog, says_that_a_log_has_no_imu_at_all) {
  const auto path = (folder_ / "log").string();
  {
    Rosbag2Writer writer(path);
    writer.write("points", kStart_ns, sample_cloud(0));
    writer.write("gps/fix", kStart_ns, sample_fix(0));
  }
  EXPECT_THAT(refusal(path, RobotConfig{}),
              AllOf(HasSubstr("'imu/data'"),
                    HasSubstr("no topic of type sensor_msgs/msg/Imu is in the log. The log has:")));
}

TEST_F(OpenLog, refuses_a_topic_of_another_type) {
  auto wrong = robot();
  wrong.points_topic = "imu_raw";
  EXPECT_THAT(refusal(recorded(), wrong),
              AllOf(HasSubstr("is of type sensor_msgs/msg/Imu"),
                    HasSubstr("expected sensor_msgs/msg/PointCloud2"),
                    HasSubstr("'/points_raw'")));
}

// ---- wheels and heading -------------------------------------------------------------------------

class OpenLogWithAiding : public OpenLog {
 protected:
  /// One second with wheels at 50 Hz, also as an Odometry, and a heading at 5 Hz.
  std::string with_aiding() {
    const auto path = (folder_ / "aided").string();
    Rosbag2Writer writer(path);
    for (int i = 0; i < 100; ++i) {
      writer.write("imu/data", sample_imu(i).stamp_ns, sample_imu(i));
      if (i % 2 == 0) {
        writer.write("wheels", sample_twist(i / 2).stamp_ns, sample_twist(i / 2));
        writer.write("odom", sample_twist(i / 2).stamp_ns, odometry(sample_twist(i / 2)));
      }
      if (i % 20 == 0) {
        writer.write("compass", sample_yaw(i / 20).stamp_ns, sample_yaw(i / 20));
      }
    }
    return path;
  }

  static Odometry odometry(const TwistMeasurement& twist) {
    Odometry odometry;
    odometry.stamp_ns = twist.stamp_ns;
    odometry.frame_id = "odom";
    odometry.child_frame_id = twist.frame_id;
    odometry.T_frame_child.p = {100.0, 200.0, 300.0};
    odometry.linear_mps = twist.linear_mps;
    odometry.angular_radps = {7.0, 8.0, 9.0};
    odometry.twist_covariance.topLeftCorner<3, 3>() = twist.covariance_m2ps2;
    return odometry;
  }

  static LogOptions imu_alone() {
    LogOptions options;
    options.require_points = options.require_fix = false;
    return options;
  }

  std::vector<LogEntry> entries(const RobotConfig& robot) {
    return read_all(*open_log(with_aiding(), robot, imu_alone()));
  }
};

TEST_F(OpenLogWithAiding, leaves_them_alone_when_the_robot_has_no_topics_for_them) {
  EXPECT_EQ(100U, entries(RobotConfig{}).size());
}

TEST_F(OpenLogWithAiding, delivers_twists_in_order_with_the_rest) {
  RobotConfig robot;
  robot.twist_topic = "/wheels";
  const auto all = entries(robot);
  const auto twists = only<TwistMeasurement>(all);
  ASSERT_EQ(50U, twists.size());
  EXPECT_EQ(100U, only<ImuSample>(all).size());
  for (int i = 0; i < 50; ++i) {
    expect_equal(sample_twist(i), twists[static_cast<std::size_t>(i)]);
  }
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end(), [](const LogEntry& a, const LogEntry& b) {
    return a.receive_ns < b.receive_ns;
  }));
}

TEST_F(OpenLogWithAiding, takes_the_twist_of_an_odometry) {
  RobotConfig robot;
  robot.twist_topic = "odom";
  robot.twist_message = "Odometry";
  const auto twists = only<TwistMeasurement>(entries(robot));
  ASSERT_EQ(50U, twists.size());
  expect_equal(sample_twist(7), twists[7]);
}

TEST_F(OpenLogWithAiding, delivers_headings) {
  RobotConfig robot;
  robot.yaw_topic = "compass";
  const auto yaws = only<YawMeasurement>(entries(robot));
  ASSERT_EQ(5U, yaws.size());
  expect_equal(sample_yaw(3), yaws[3]);
}

TEST_F(OpenLogWithAiding, takes_an_imu_that_is_also_the_heading_for_both) {
  RobotConfig robot;
  robot.yaw_topic = "/imu/data";
  const auto all = entries(robot);
  const auto yaws = only<YawMeasurement>(all);
  ASSERT_EQ(100U, yaws.size());
  EXPECT_EQ(100U, only<ImuSample>(all).size());
  EXPECT_EQ(sample_imu(42).stamp_ns, yaws[42].stamp_ns);
  EXPECT_EQ(sample_imu(42).q_world_base->coeffs(), yaws[42].q_world_base->coeffs());
}

TEST_F(OpenLogWithAiding, refuses_a_log_without_a_topic_that_was_named_unless_told_otherwise) {
  RobotConfig robot;
  robot.twist_topic = "weels";
  EXPECT_THAT(message_of<LogError>([&] { open_log(with_aiding(), robot, imu_alone()); }),
              AllOf(HasSubstr("robot.twist_topic"), HasSubstr("did you mean '/wheels'?")));
  LogOptions lenient = imu_alone();
  lenient.require_aiding = false;
  EXPECT_EQ(100U, read_all(*open_log((folder_ / "aided").string(), robot, lenient)).size());
}

TEST_F(OpenLogWithAiding, refuses_twists_of_the_other_type) {
  RobotConfig robot;
  robot.twist_topic = "odom";
  EXPECT_THAT(message_of<LogError>([&] { open_log(with_aiding(), robot, imu_alone()); }),
              AllOf(HasSubstr("is of type nav_msgs/msg/Odometry"),
                    HasSubstr("expected geometry_msgs/msg/TwistWithCovarianceStamped")));
}

TEST_F(OpenLog, refuses_what_is_no_log) {
  EXPECT_THAT(refusal((folder_ / "nothing.bag").string(), RobotConfig{}),
              AllOf(HasSubstr("nothing.bag"), HasSubstr("does not exist")));
  std::ofstream(folder_ / "empty.bag");
  EXPECT_THAT(refusal((folder_ / "empty.bag").string(), RobotConfig{}), HasSubstr("empty"));
  std::ofstream(folder_ / "notes.txt") << "hello";
  EXPECT_THAT(refusal((folder_ / "notes.txt").string(), RobotConfig{}),
              HasSubstr("no log that is known here"));
}

TEST_F(OpenLog, refuses_devices_and_files_beside_a_log_with_a_hint) {
  EXPECT_THAT(refusal("/dev/null", RobotConfig{}), HasSubstr("no log that is known here"));
  std::ofstream(folder_ / "map.pcd") << "# .PCD";
  EXPECT_THAT(refusal((folder_ / "map.pcd").string(), RobotConfig{}),
              AllOf(HasSubstr("map.pcd"), HasSubstr("or a scenario")));
  EXPECT_THAT(refusal(recorded() + "/metadata.yaml", RobotConfig{}), HasSubstr("name the folder"));
}

TEST_F(OpenLog, refuses_an_empty_log) {
  const auto path = (folder_ / "log").string();
  {
    Rosbag2Writer writer(path);
    writer.declare_topic("imu/data", "sensor_msgs/msg/Imu", Durability::kVolatile);
  }
  EXPECT_THAT(refusal(path, RobotConfig{}), HasSubstr("empty"));
}

TEST_F(OpenLog, does_without_a_topic_that_is_not_required) {
  auto without = robot();
  without.points_topic = "elsewhere";
  LogOptions options;
  options.require_points = false;
  const auto entries = read_all(*open_log(recorded(), without, options));
  EXPECT_EQ(1100U, entries.size());
}

TEST_F(OpenLog, withholds_fixes_beyond_the_rate_but_delivers_them) {
  LogOptions options;
  options.fix_rate_limit_hz = 1.0;
  const auto entries = read_all(*open_log(recorded(), robot(), options));
  std::vector<Nanoseconds> fed;
  int withheld = 0;
  for (const auto& entry : entries) {
    if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      if (entry.withheld) {
        ++withheld;
      } else {
        fed.push_back(fix->stamp_ns);
      }
    } else {
      EXPECT_FALSE(entry.withheld) << "only fixes are withheld";
    }
  }
  EXPECT_EQ(100, withheld + static_cast<int>(fed.size()));
  // 9.9 s of fixes: the first at once, then one a second.
  EXPECT_EQ(11U, fed.size());
  EXPECT_EQ(kStart_ns, fed[0]);
  EXPECT_EQ(kNanosecondsPerSecond, fed[5] - fed[4]);
}

TEST_F(OpenLog, a_limit_at_the_rate_of_the_fixes_withholds_none) {
  LogOptions options;
  options.fix_rate_limit_hz = 10.0;
  for (const auto& entry : read_all(*open_log(recorded(), robot(), options))) {
    EXPECT_FALSE(entry.withheld);
  }
}

TEST_F(OpenLog, delivers_the_part_that_was_asked_for) {
  LogOptions options;
  options.start_s = 2.0;
  options.duration_s = 3.0;
  const auto log = open_log(recorded(), robot(), options);
  const auto entries = read_all(*log);
  EXPECT_EQ(kStart_ns + 2 * kNanosecondsPerSecond, entries.front().receive_ns);
  EXPECT_EQ(kStart_ns + 5 * kNanosecondsPerSecond, entries.back().receive_ns);
  EXPECT_EQ(1.0, log->progress());
}

TEST_F(OpenLog, finds_the_truth_beside_a_simulated_log) {
  const auto path = recorded();
  EXPECT_FALSE(open_log(path, robot())->truth_file());
  std::ofstream(folder_ / "truth.tum") << "# t x y z qx qy qz qw\n";
  EXPECT_EQ((folder_ / "truth.tum").string(), open_log(path, robot())->truth_file().value_or(""));
  EXPECT_EQ((folder_ / "truth.tum").string(),
            open_log(path + "/", robot())->truth_file().value_or(""));
  EXPECT_EQ((folder_ / "truth.tum").string(),
            open_log(path + "/log_0.db3", robot())->truth_file().value_or(""));
}

TEST_F(OpenLog, a_duration_beyond_the_log_is_all_of_it_however_long) {
  const std::string log = recorded();
  for (const double duration_s : {10.5, 1e300}) {
    LogOptions options;
    options.duration_s = duration_s;
    EXPECT_EQ(1000U, only<ImuSample>(read_all(*open_log(log, robot(), options))).size());
  }
}

TEST_F(OpenLog, refuses_to_skip_the_whole_log) {
  const std::string log = recorded();
  for (const double start_s : {10.0, 1e300}) {
    LogOptions options;
    options.start_s = start_s;
    EXPECT_THAT(message_of<ConfigError>([&] { open_log(log, robot(), options); }),
                AllOf(HasSubstr(log), HasSubstr("lasts 9.99 s"), HasSubstr("log.start_s")));
  }
}

TEST_F(OpenLog, names_a_folder_that_may_not_be_read) {
  const std::string log = recorded();
  namespace fs = std::filesystem;
  fs::permissions(folder_.path(), fs::perms{0755});
  fs::permissions(log, fs::perms{0000});
  const bool is_root = geteuid() == 0;
  constexpr uid_t kNobody = 65534;
  ASSERT_TRUE(!is_root || seteuid(kNobody) == 0);
  const std::string refused = refusal(log, robot());
  ASSERT_TRUE(!is_root || seteuid(0) == 0);
  fs::permissions(log, fs::perms{0755});
  EXPECT_THAT(refused, HasSubstr(log + ": cannot be read: Permission denied"));
}

}  // namespace
}  // namespace trigpoint::recording
