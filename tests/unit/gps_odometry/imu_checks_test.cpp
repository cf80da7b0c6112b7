// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_checks.hpp"

#include "drive.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

ImuChecks warm_checks() {
  ImuChecks checks(Config{}, Eigen::Quaterniond::Identity());
  for (int i = 0; i < 30; ++i) {
    checks.check(imu_at(0.01 * i));
  }
  return checks;
}

/// The verdict on the last of a second of samples that `change` made different.
template <typename Change>
ImuVerdict after_a_second(const Change& change) {
  ImuChecks checks(Config{}, Eigen::Quaterniond::Identity());
  ImuVerdict verdict;
  for (int i = 0; i < 100; ++i) {
    ImuSample sample = imu_at(0.01 * i);
    change(sample);
    verdict = checks.check(sample);
    EXPECT_FALSE(verdict.sample.has_value());
  }
  EXPECT_TRUE(checks.is_faulty());
  return verdict;
}

TEST(ImuChecks, passes_good_samples_after_the_warm_up) {
  ImuChecks checks = warm_checks();
  const ImuVerdict verdict = checks.check(imu_at(0.30));
  ASSERT_TRUE(verdict.sample.has_value());
  EXPECT_NEAR(verdict.sample->mean_accel_mps2.z(), 9.80665, 1e-6);
}

TEST(ImuChecks, refuses_numbers_that_are_not_finite) {
  ImuChecks checks = warm_checks();
  ImuSample sample = imu_at(0.30);
  sample.gyro_radps.x() = kNaN;
  EXPECT_EQ(checks.check(sample).reason, "imu_not_finite");
}

TEST(ImuChecks, refuses_time_that_goes_back_or_stands_still) {
  ImuChecks checks = warm_checks();
  EXPECT_EQ(checks.check(imu_at(0.28)).reason, "imu_time_backwards");
  EXPECT_EQ(checks.check(imu_at(0.29)).reason, "imu_duplicate_stamp");
  EXPECT_TRUE(checks.check(imu_at(0.30)).sample);
}

TEST(ImuChecks, does_not_follow_one_stamp_that_jumps) {
  ImuChecks checks = warm_checks();
  EXPECT_EQ(checks.check(imu_at(3600.0)).reason, "imu_time_jump");
  EXPECT_TRUE(checks.check(imu_at(0.30)).sample);
}

TEST(ImuChecks, follows_a_clock_that_moved_and_stays_there) {
  ImuChecks checks = warm_checks();
  EXPECT_EQ(checks.check(imu_at(-10.00)).reason, "imu_time_jump");
  EXPECT_EQ(checks.check(imu_at(-9.99)).reason, "imu_time_jump");
  const ImuVerdict verdict = checks.check(imu_at(-9.98));
  EXPECT_TRUE(verdict.clock_reset);
  EXPECT_TRUE(verdict.sample);
}

TEST(ImuChecks, refuses_an_accelerometer_in_g_and_names_the_value) {
  const ImuVerdict verdict =
      after_a_second([](ImuSample& sample) { sample.accel_mps2 /= 9.80665; });
  EXPECT_EQ(verdict.reason, "imu_units_g");
  EXPECT_NE(verdict.text.find("is 1, expected about 9.8 m/s^2"), std::string::npos) << verdict.text;
}

TEST(ImuChecks, refuses_an_accelerometer_without_gravity) {
  const ImuVerdict verdict =
      after_a_second([](ImuSample& sample) { sample.accel_mps2.z() -= 9.80665; });
  EXPECT_EQ(verdict.reason, "imu_without_gravity");
}

TEST(ImuChecks, refuses_an_imu_upside_down) {
  const ImuVerdict verdict =
      after_a_second([](ImuSample& sample) { sample.accel_mps2.z() *= -1.0; });
  EXPECT_EQ(verdict.reason, "imu_upside_down");
}

TEST(ImuChecks, refuses_rates_in_degrees_and_impossible_forces) {
  ImuChecks checks = warm_checks();
  ImuSample fast = imu_at(0.30);
  fast.gyro_radps.z() = 57.0;
  EXPECT_EQ(checks.check(fast).reason, "imu_out_of_range");
  ImuSample hard = imu_at(0.30);
  hard.accel_mps2.x() = 1e6;
  EXPECT_EQ(checks.check(hard).reason, "imu_out_of_range");
}

TEST(ImuChecks, refuses_a_gyro_in_degrees_from_its_first_turn_on) {
  ImuChecks checks(Config{}, Eigen::Quaterniond::Identity());
  ImuVerdict verdict;
  for (int i = 0; i < 200; ++i) {
    ImuSample sample = imu_at(0.01 * i);
    sample.gyro_radps.z() = 17.2 + 1e-3 * (i % 7);
    verdict = checks.check(sample);
  }
  EXPECT_EQ(verdict.reason, "imu_gyro_in_degrees");
  EXPECT_NE(verdict.text.find("0.0174533"), std::string::npos) << verdict.text;
  EXPECT_TRUE(checks.is_faulty());
}

TEST(ImuChecks, passes_a_turn_in_place_at_90_degrees_a_second) {
  ImuChecks checks(Config{}, Eigen::Quaterniond::Identity());
  ImuVerdict verdict;
  for (int i = 0; i < 500; ++i) {
    ImuSample sample = imu_at(0.01 * i);
    sample.gyro_radps.z() = 1.5708 + 1e-3 * (i % 7);
    verdict = checks.check(sample);
  }
  EXPECT_TRUE(verdict.sample);
}

TEST(ImuChecks, refuses_an_imu_that_is_stuck) {
  ImuChecks checks = warm_checks();
  ImuVerdict verdict;
  for (int i = 30; i < 60; ++i) {
    ImuSample sample = imu_at(0.29);
    sample.stamp_ns = stamp_of(0.01 * i);
    verdict = checks.check(sample);
  }
  EXPECT_EQ(verdict.reason, "imu_stuck");
}

TEST(ImuChecks, turns_samples_into_base_link) {
  RobotConfig robot;
  robot.imu_roll_pitch_yaw_base_rad = {0.0, 0.0, 1.5707963267948966};
  ImuChecks checks(Config{}, robot.q_base_imu());
  ImuVerdict verdict;
  for (int i = 0; i < 30; ++i) {
    ImuSample sample = imu_at(0.01 * i);
    sample.accel_mps2.x() = 1.0;
    verdict = checks.check(sample);
  }
  ASSERT_TRUE(verdict.sample);
  EXPECT_NEAR(verdict.sample->accel_mps2.y(), 1.0, 1e-3);
}

TEST(RestBias, is_the_mean_of_the_gyro_at_rest) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 0.002);
  RestBias rest{Config{}};
  const Eigen::Vector3d bias(0.002, -0.001, 0.003);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
    rest.add(from_seconds(0.01 * i), bias + noise, {0.0, 0.0, 9.80665});
  }
  EXPECT_LT((rest.bias_radps() - bias).norm(), 3.0 * Config{}.gyro_bias_rest_sigma_radps);
  EXPECT_EQ(rest.sigma_radps(), Config{}.gyro_bias_rest_sigma_radps);
}

TEST(RestBias, learns_nothing_from_driving) {
  RestBias rest{Config{}};
  for (int i = 0; i < 500; ++i) {
    const double t = 0.01 * i;
    rest.add(
        from_seconds(t), {0.0, 0.0, 0.1 * std::sin(3.0 * t)}, {0.5 * std::sin(20.0 * t), 0.0, 9.8});
  }
  EXPECT_EQ(rest.bias_radps().norm(), 0.0);
  EXPECT_EQ(rest.sigma_radps(), Config{}.gyro_bias_sigma_radps);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
