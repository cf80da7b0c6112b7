// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The rules around the strict filter one by one, and all of them on the two bags with which the
// published filter tests itself. The bags' end poses see gravity and the mounting; lever arm, late
// data and the choice of axes move them by a centimetre, so those have tests of their own.
#include "moore_stouch_replay.hpp"

#include "trigpoint/base/so3.hpp"

#include "bag_messages.hpp"
#include "measured_states.hpp"
#include "rosbag1_source.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

namespace trigpoint::gps_odometry {
namespace {

constexpr Nanoseconds kSecond = kNanosecondsPerSecond;
constexpr double kTimeout_s = 0.1;
constexpr double kAdopted = 1e-6;  // what is left of the state before, with variances 1e6 and 1e-3

/// A filter at rest that knows so little that it takes over what is measured.
MooreStouch ignorant() {
  MooreStouch filter;
  filter.initialised = true;
  filter.P = 1e6 * Matrix15d::Identity();
  return filter;
}

const MeasuredStates kAllOfTheImu = states({3, 4, 5, 9, 10, 11, 12, 13, 14});

/// What an IMU at T_base_imu reports when the vehicle has this attitude, turns with this rate and
/// is accelerated at the IMU like this, in base_link.
AhrsSample sample_of(const Eigen::Isometry3d& T_base_imu,
                     const Eigen::Quaterniond& q_world_base,
                     const Eigen::Vector3d& rate_base_radps,
                     const Eigen::Vector3d& acceleration_base_mps2) {
  const Eigen::Matrix3d R_imu_base = T_base_imu.linear().transpose();
  AhrsSample sample;
  sample.q_world_imu = q_world_base * Eigen::Quaterniond(T_base_imu.linear());
  sample.gyro_radps = R_imu_base * rate_base_radps;
  const Eigen::Vector3d up_base = q_world_base.conjugate() * Eigen::Vector3d::UnitZ();
  sample.accel_mps2 = R_imu_base * (acceleration_base_mps2 + kGravity_mps2 * up_base);
  sample.attitude_covariance_rad2 = sample.gyro_covariance = sample.accel_covariance =
      1e-3 * Eigen::Matrix3d::Identity();
  return sample;
}

Eigen::Isometry3d mounting_of_the_husky() {
  Eigen::Isometry3d T_base_imu = Eigen::Isometry3d::Identity();
  T_base_imu.linear() = from_roll_pitch_yaw({1.570796327, 0.0, -1.570796327}).toRotationMatrix();
  T_base_imu.translation() << 0.0, -0.3, 0.52;
  return T_base_imu;
}

TwistSample forward(Nanoseconds stamp_ns, double speed_mps) {
  TwistSample sample;
  sample.stamp_ns = stamp_ns;
  sample.twist_base(0) = speed_mps;
  sample.covariance = 1e-3 * Eigen::Matrix<double, 6, 6>::Identity();
  return sample;
}

TEST(Ekf15Strict, turns_what_a_rotated_imu_measures_into_the_vehicles_axes) {
  const ImuUse use{mounting_of_the_husky(), kAllOfTheImu};
  const Eigen::Vector3d rpy_rad(0.1, -0.2, 0.7);
  const Eigen::Vector3d acceleration_mps2(0.5, -0.3, 0.2);
  MooreStouchReplay replay(ignorant(), kTimeout_s);
  const AhrsSample sample =
      sample_of(use.T_base_imu, from_roll_pitch_yaw(rpy_rad), {0.3, 0.2, -0.1}, acceleration_mps2);
  replay.add(sample, use);
  replay.tick(0);
  const Vector15d& x = replay.filter().x;
  EXPECT_LT((x.segment<3>(kAttitude) - rpy_rad).norm(), kAdopted);
  EXPECT_LT((x.segment<3>(kRate) - Eigen::Vector3d(0.3, 0.2, -0.1)).norm(), kAdopted);
  EXPECT_LT((x.segment<3>(kAcceleration) - acceleration_mps2).norm(), kAdopted);
}

TEST(Ekf15Strict, removes_gravity_with_its_own_attitude_where_the_imu_gives_none) {
  const ImuUse use{mounting_of_the_husky(), kAllOfTheImu};
  const Eigen::Vector3d rpy_rad(0.1, -0.2, 0.7);
  MooreStouch start = ignorant();
  start.x.segment<3>(kAttitude) = rpy_rad;
  MooreStouchReplay replay(start, kTimeout_s);
  AhrsSample sample =
      sample_of(use.T_base_imu, from_roll_pitch_yaw(rpy_rad), {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0});
  sample.q_world_imu.reset();
  replay.add(sample, use);
  replay.tick(0);
  EXPECT_LT(replay.filter().x.segment<3>(kAcceleration).norm(), kAdopted);
}

TEST(Ekf15Strict, measures_the_vehicles_axes_into_which_the_chosen_ones_of_the_imu_are_turned) {
  // x of this IMU is -y of base_link, its y is z, its z (not chosen) is -x.
  const ImuUse use{mounting_of_the_husky(), states({kRate, kRate + 1})};
  MooreStouchReplay replay(ignorant(), kTimeout_s);
  replay.add(
      sample_of(use.T_base_imu, Eigen::Quaterniond::Identity(), {0.3, 0.2, -0.1}, {0.0, 0.0, 0.0}),
      use);
  replay.tick(0);
  const Vector15d& x = replay.filter().x;
  EXPECT_EQ(x(kRate), 0.0);
  EXPECT_NEAR(x(kRate + 1), 0.2, kAdopted);
  EXPECT_NEAR(x(kRate + 2), -0.1, kAdopted);
}

TEST(Ekf15Strict, removes_what_the_lever_arm_of_the_imu_adds_to_its_acceleration) {
  const ImuUse use{mounting_of_the_husky(), kAllOfTheImu};
  const Eigen::Vector3d r = use.T_base_imu.translation();
  const Eigen::Vector3d w(0.0, 0.1, 0.4);
  const Eigen::Vector3d w_before(0.0, 0.0, 0.2);
  const Eigen::Vector3d alpha = (w - w_before) / 0.1;
  MooreStouch start = ignorant();
  start.x.segment<3>(kRate) = w_before;
  MooreStouchReplay replay(start, kTimeout_s);
  replay.tick(0);
  TwistSample turning;
  turning.twist_base.tail<3>() = w;
  turning.covariance = 1e-3 * Eigen::Matrix<double, 6, 6>::Identity();
  replay.add(turning, states({kRate, kRate + 1, kRate + 2}));
  replay.tick(kSecond / 10);
  // base_link itself is not accelerated; the IMU beside it is, by dw/dt x r + w x (w x r).
  replay.add(
      sample_of(
          use.T_base_imu, Eigen::Quaterniond::Identity(), w, alpha.cross(r) + w.cross(w.cross(r))),
      use);
  replay.tick(2 * kSecond / 10);
  EXPECT_LT(replay.filter().x.segment<3>(kAcceleration).norm(), 10.0 * kAdopted);
}

TEST(Ekf15Strict, lets_what_is_stamped_in_the_future_wait) {
  MooreStouchReplay replay(ignorant(), kTimeout_s);
  replay.add(forward(kSecond, 1.0), states({kVelocity}));
  replay.tick(kSecond - 1);
  EXPECT_EQ(replay.filter().x(kVelocity), 0.0);
  replay.tick(kSecond);
  EXPECT_NEAR(replay.filter().x(kVelocity), 1.0, kAdopted);
}

TEST(Ekf15Strict, fuses_late_data_into_the_present_state) {
  const ImuUse use{Eigen::Isometry3d::Identity(), states({kRate + 2})};
  MooreStouchReplay replay(ignorant(), kTimeout_s);
  replay.add(forward(2 * kSecond, 1.0), states({kVelocity}));
  replay.tick(2 * kSecond);
  const Vector15d before = replay.filter().x;
  AhrsSample late =
      sample_of(use.T_base_imu, Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.5}, {0.0, 0.0, 0.0});
  late.stamp_ns = kSecond;
  replay.add(late, use);
  replay.tick(2 * kSecond);
  EXPECT_EQ(replay.late_measurements(), 1);
  EXPECT_NEAR(replay.filter().x(kRate + 2), 0.5, kAdopted);
  EXPECT_EQ(replay.filter().x(kPosition), before(kPosition));  // it did not predict
}

TEST(Ekf15Strict, drops_what_is_older_than_the_last_of_its_kind_but_not_what_is_as_old) {
  MooreStouchReplay replay({}, kTimeout_s);
  replay.add(forward(kSecond, 1.0), states({kVelocity}));
  replay.add(forward(kSecond, 1.0), states({kVelocity}));
  replay.add(forward(kSecond - 1, 1.0), states({kVelocity}));
  replay.tick(kSecond);
  // The first is copied, the second is as good again.
  EXPECT_NEAR(replay.filter().P(kVelocity, kVelocity), 1e-3 / 2.0, kAdopted);
}

TEST(Ekf15Strict, predicts_for_ever_once_nothing_came_for_the_time_out) {
  MooreStouchReplay replay({}, kTimeout_s);
  replay.add(forward(kSecond, 1.0), states({kVelocity}));
  replay.tick(kSecond);
  const auto travelled_m = [&] { return replay.filter().x(kPosition); };
  replay.tick(kSecond + from_seconds(0.09));
  EXPECT_EQ(travelled_m(), 0.0);
  replay.tick(kSecond + from_seconds(0.11));
  EXPECT_NEAR(travelled_m(), 0.11, kAdopted);
  replay.tick(kSecond + from_seconds(60.0));
  EXPECT_NEAR(travelled_m(), 60.0, kAdopted);
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
  run.imu.T_base_imu = mounting_of_the_husky();
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
