// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// research/gps table E, the IMU: each fault counted by its name, over both filters.
#include "driven.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace trigpoint::gps_odometry {
namespace {

// ---- samples that are refused one by one --------------------------------------------------------

struct BadSample {
  const char* reason;
  void (*spoil)(ImuSample&);
};

class BadSamples : public testing::TestWithParam<std::tuple<const char*, BadSample>> {};

TEST_P(BadSamples, are_counted_and_leave_the_state_as_it_was) {
  const auto& [filter, bad] = GetParam();
  Driven driven(filter);
  std::uint64_t spoilt = 0;
  for (Input& input : driven.inputs) {
    // One of ten, for ten seconds.
    if (!input.is_fix && input.available_s > 20.0 && input.available_s < 30.0 &&
        (input.imu.stamp_ns / 10'000'000) % 10 == 3) {
      bad.spoil(input.imu);
      ++spoilt;
    }
  }
  driven.advance(40.0);
  EXPECT_EQ(count_of(driven.status, bad.reason), spoilt);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
  EXPECT_EQ(driven.status.reset.counter, 1U) << "the one of the first heading";
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
}

INSTANTIATE_TEST_SUITE_P(
    TableE,
    BadSamples,
    testing::Combine(
        testing::Values("ekf15", "eskf18"),
        testing::Values(
            BadSample{"imu_not_finite", [](ImuSample& i) { i.gyro_radps.y() = kNaN; }},
            BadSample{
                "imu_not_finite",
                [](ImuSample& i) { i.accel_mps2.z() = -std::numeric_limits<double>::infinity(); }},
            BadSample{"imu_out_of_range", [](ImuSample& i) { i.gyro_radps.z() = 250.0; }},
            BadSample{"imu_out_of_range", [](ImuSample& i) { i.accel_mps2.x() = 9806.65; }},
            BadSample{"imu_stamp_out_of_range",
                      [](ImuSample& i) { i.stamp_ns = std::numeric_limits<Nanoseconds>::min(); }},
            BadSample{"imu_duplicate_stamp", [](ImuSample& i) { i.stamp_ns -= 10'000'000; }},
            BadSample{"imu_time_backwards", [](ImuSample& i) { i.stamp_ns -= 500'000'000; }},
            BadSample{"imu_time_jump",
                      [](ImuSample& i) { i.stamp_ns += 3600 * kNanosecondsPerSecond; }})));

// ---- an IMU that is not what it should be -------------------------------------------------------

struct BadImu {
  const char* reason;
  void (*spoil)(ImuSample&);
};

class BadImus : public testing::TestWithParam<std::tuple<const char*, BadImu>> {};

TEST_P(BadImus, are_a_fault_and_nothing_comes_of_them) {
  const auto& [filter_name, bad] = GetParam();
  const auto truth = drive(town(1.5, 3.0), 60.0);
  auto inputs = sense(truth, rtk_robot(), 1);
  for (Input& input : inputs) {
    bad.spoil(input.imu);
  }
  GpsOdometry filter(config_with_datum(filter_name), rtk_robot().robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_EQ(result.statuses.back().health, GpsHealth::kFault);
  EXPECT_GT(count_of(result.statuses.back(), bad.reason), 100U);
  EXPECT_TRUE(has_event(result.events, bad.reason));
  // What turns show takes three corners; what rest shows takes none.
  EXPECT_TRUE(result.odometry.empty() ||
              to_seconds(result.odometry.back().stamp_ns - kEpoch_ns) < 50.0);
  for (const Odometry& odometry : result.odometry) {
    ASSERT_TRUE(odometry.T_frame_child.is_finite());
    ASSERT_TRUE(odometry.pose_covariance.allFinite());
  }
}

INSTANTIATE_TEST_SUITE_P(
    TableE,
    BadImus,
    testing::Combine(
        testing::Values("ekf15", "eskf18"),
        testing::Values(
            BadImu{"imu_units_g", [](ImuSample& i) { i.accel_mps2 /= 9.80665; }},
            BadImu{"imu_without_gravity", [](ImuSample& i) { i.accel_mps2.z() -= 9.80665; }},
            BadImu{"imu_upside_down",
                   [](ImuSample& i) {
                     i.accel_mps2 = {i.accel_mps2.x(), -i.accel_mps2.y(), -i.accel_mps2.z()};
                     i.gyro_radps = {i.gyro_radps.x(), -i.gyro_radps.y(), -i.gyro_radps.z()};
                   }},
            BadImu{"imu_gyro_sign", [](ImuSample& i) { i.gyro_radps *= -1.0; }},
            BadImu{"imu_gyro_in_degrees",
                   [](ImuSample& i) { i.gyro_radps *= 25.0; }},  // below the limit of range
            BadImu{"imu_stuck", [](ImuSample& i) {
                     i.gyro_radps.setConstant(0.001);
                     i.accel_mps2 = {0.0, 0.0, 9.81};
                   }})));

class Imu : public testing::TestWithParam<const char*> {};

TEST_P(Imu, that_gets_stuck_is_a_fault_until_it_moves_again) {
  Driven driven(GetParam());
  for (Input& input : driven.inputs) {
    if (input.available_s > 20.0 && input.available_s < 20.8) {
      input.imu.gyro_radps.setConstant(0.001);
      input.imu.accel_mps2 = {0.0, 0.0, 9.81};
    }
  }
  driven.advance(20.75);
  EXPECT_EQ(driven.status.health, GpsHealth::kFault);
  EXPECT_GT(count_of(driven.status, "imu_stuck"), 10U);
  driven.advance(35.0);
  EXPECT_NE(driven.status.health, GpsHealth::kFault);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST_P(Imu, that_saturates_for_a_moment_costs_certainty_and_not_the_state) {
  Driven driven(GetParam());
  const double before = driven.odometry.pose_covariance(5, 5);
  double worst = 0.0;
  for (Input& input : driven.inputs) {
    if (!input.is_fix && input.available_s > 20.0 && input.available_s < 20.1) {
      input.imu.gyro_radps.z() = 8.7;
      input.imu.accel_mps2.x() = 78.0;
    }
  }
  for (double t = 20.0; t < 21.0; t += 0.02) {
    driven.advance(t);
    worst = std::max(worst, driven.odometry.pose_covariance(5, 5));
  }
  if (std::string(GetParam()) == "eskf18") {
    EXPECT_GT(worst, 2.0 * before);
  }
  driven.advance(50.0);
  EXPECT_LT(driven.error_m(), 2.0 * kRtkTolerance_m);
}

TEST_P(Imu, that_was_silent_for_long_starts_anew) {
  Driven driven(GetParam());
  std::erase_if(driven.inputs, [](const Input& input) {
    return !input.is_fix && input.available_s > 20.0 && input.available_s < 27.0;
  });
  driven.advance(55.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
}

INSTANTIATE_TEST_SUITE_P(Filters, Imu, testing::Values("ekf15", "eskf18"));

// ---- health -------------------------------------------------------------------------------------

class HealthOfADrive : public testing::TestWithParam<const char*> {};

TEST_P(HealthOfADrive, goes_through_all_that_it_knows) {
  const auto truth = drive(town(1.5, 3.0), 95.0);
  auto inputs = sense(truth, rtk_robot(), 2);
  std::erase_if(inputs, [](const Input& input) {
    return input.is_fix && input.available_s > 40.0 && input.available_s < 75.0;
  });
  GpsOdometry filter(config_with_datum(GetParam()), rtk_robot().robot);
  EXPECT_EQ(filter.status().health, GpsHealth::kInit);
  const Recorded result = run(filter, inputs, truth);
  const auto at = [&](double time_s) {
    return *std::find_if(result.statuses.begin(), result.statuses.end(), [&](const GpsStatus& s) {
      return s.stamp_ns >= stamp_of(time_s);
    });
  };
  EXPECT_EQ(at(2.0).health, GpsHealth::kDegraded) << "no heading yet";
  EXPECT_EQ(at(39.0).health, GpsHealth::kOk);
  EXPECT_EQ(at(39.0).gnss_class, GnssClass::kFixed);
  EXPECT_LT(at(39.0).test_ratio[0], 1.0);
  EXPECT_EQ(at(45.0).health, GpsHealth::kDeadReckoning);
  EXPECT_NEAR(to_seconds(at(45.0).last_accepted_fix_ns - kEpoch_ns), 39.8, 0.25);
  EXPECT_EQ(at(73.0).health, GpsHealth::kStale);
  EXPECT_EQ(at(73.0).last_accepted_fix_ns, at(45.0).last_accepted_fix_ns);
  EXPECT_GT(to_seconds(at(90.0).last_accepted_fix_ns - kEpoch_ns), 85.0) << "back again";
  EXPECT_GE(at(90.0).reset.counter, 1U);
}

INSTANTIATE_TEST_SUITE_P(Filters, HealthOfADrive, testing::Values("ekf15", "eskf18"));

}  // namespace
}  // namespace trigpoint::gps_odometry
