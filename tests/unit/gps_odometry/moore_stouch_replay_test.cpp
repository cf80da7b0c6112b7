// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The strict filter and its timing on the two bags with which the published filter tests itself.
#include "moore_stouch_replay.hpp"

#include "trigpoint/base/so3.hpp"

#include "bag_messages.hpp"
#include "rosbag1_source.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

namespace trigpoint::gps_odometry {
namespace {

MeasuredStates states(std::initializer_list<int> indices) {
  MeasuredStates measured;
  for (const int i : indices) {
    measured.set(static_cast<std::size_t>(i));
  }
  return measured;
}

/// One run of the published filter, settings and inputs as in its own regression test.
struct BagRun {
  std::string file;
  std::string twist_topic;
  double frequency_hz{30.0};
  double sensor_timeout_s{0.1};
  Vector15d process_noise_per_s{published_process_noise()};
  MeasuredStates twist_measured;
  ImuUse imu;
  Eigen::Vector3d expected_end_m;
  double tolerance_m{0.0};
};

struct BagEnd {
  Eigen::Vector3d position_m;
  int imu_messages{0};
  int twist_messages{0};
  int late_measurements{0};
};

BagEnd replay(const BagRun& run) {
  const auto bag = recording::open_rosbag1(run.file);
  bag->select({"/imu/data", run.twist_topic});
  MooreStouch start;
  start.process_noise_per_s = run.process_noise_per_s;
  MooreStouchReplay replayed(start, run.sensor_timeout_s);
  const double period_s = 1.0 / run.frequency_hz;
  std::optional<Nanoseconds> first_ns;
  long ticks = 0;
  BagEnd end;
  const auto next_tick_ns = [&] {
    return *first_ns + from_seconds(period_s * static_cast<double>(ticks + 1));
  };
  while (const auto raw = bag->next()) {
    first_ns = first_ns.value_or(raw->receive_ns);
    for (; next_tick_ns() <= raw->receive_ns; ++ticks) {
      replayed.tick(next_tick_ns());
    }
    if (raw->topic == "/imu/data") {
      replayed.add(imu_of_ros1(raw->bytes), run.imu);
      ++end.imu_messages;
    } else {
      replayed.add(twist_of_ros1(raw->bytes).sample, run.twist_measured);
      ++end.twist_messages;
    }
  }
  replayed.tick(next_tick_ns());
  end.position_m = replayed.filter().x.head<3>();
  end.late_measurements = replayed.late_measurements();
  return end;
}

void expect_end(const BagRun& run) {
  if (!std::filesystem::exists(TRIGPOINT_SHARED_DATA)) {
    GTEST_SKIP() << "no shared data in " << TRIGPOINT_SHARED_DATA;
  }
  const BagEnd end = replay(run);
  const double distance_m = (end.position_m - run.expected_end_m).norm();
  EXPECT_LE(distance_m, run.tolerance_m);
  std::printf(
      "%s: end (%.4f, %.4f, %.4f), %.4f m from the published one (tolerance %.4f); "
      "%d IMU, %d twist messages, %d measurements late\n",
      std::filesystem::path(run.file).filename().c_str(),
      end.position_m.x(),
      end.position_m.y(),
      end.position_m.z(),
      distance_m,
      run.tolerance_m,
      end.imu_messages,
      end.twist_messages,
      end.late_measurements);
}

TEST(Ekf15Strict, ends_where_the_published_filter_ends_on_the_bag_of_a_real_robot) {
  BagRun run;
  run.file = std::string(TRIGPOINT_SHARED_DATA) + "/robot_localization/test1.bag";
  run.twist_topic = "/husky_velocity_controller/odom";
  run.twist_measured = states({kVelocity, kVelocity + 1, kVelocity + 2});
  run.imu.measured = states({3, 4, 5, kRate, kRate + 1, 12, 13, 14});
  run.imu.T_base_imu.linear() =
      from_roll_pitch_yaw({1.570796327, 0.0, -1.570796327}).toRotationMatrix();
  run.imu.T_base_imu.translation() << 0.0, -0.3, 0.52;
  run.expected_end_m << -40.0454, -76.9988, -2.6974;
  run.tolerance_m = 1.0452;
  expect_end(run);
}

TEST(Ekf15Strict, ends_where_the_published_filter_ends_on_the_bag_of_a_simulated_robot) {
  BagRun run;
  run.file = std::string(TRIGPOINT_SHARED_DATA) + "/robot_localization/test2.bag";
  run.twist_topic = "/jackal_velocity_controller/odom";
  run.frequency_hz = 50.0;
  run.sensor_timeout_s = 1.0 / run.frequency_hz;  // the published default
  run.process_noise_per_s << 0.03, 0.03, 0.4, 0.03, 0.03, 0.06, 0.025, 0.025, 0.05, 0.002, 0.002,
      0.004, 0.01, 0.01, 0.01;
  run.twist_measured = states({kVelocity, kVelocity + 1, kVelocity + 2, kRate + 2});
  run.imu.measured = states({3, 4, 5, 9, 10, 11, 12, 13, 14});
  run.expected_end_m << 1.0206, 3.4292, 0.7419;
  run.tolerance_m = 0.1383;
  expect_end(run);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
