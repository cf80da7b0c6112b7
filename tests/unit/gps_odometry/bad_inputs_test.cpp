// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "driven.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <tuple>

namespace trigpoint::gps_odometry {
namespace {

// ---- bad fixes ----------------------------------------------------------------------------------

struct BadFix {
  const char* reason;
  void (*spoil)(GnssFix&);
  const char* reason_of_eskf18{nullptr};  ///< where it differs
};

class BadFixes : public testing::TestWithParam<std::tuple<const char*, BadFix>> {};

TEST_P(BadFixes, are_counted_and_leave_the_state_as_it_was) {
  const auto& [filter, bad_fix] = GetParam();
  const bool other = bad_fix.reason_of_eskf18 != nullptr && std::string(filter) == "eskf18";
  const char* reason = other ? bad_fix.reason_of_eskf18 : bad_fix.reason;
  Driven spoilt(filter);
  int bad = 0;
  // Every second fix is bad for ten seconds.
  spoilt.advance(30.0, [&](GnssFix& fix) {
    if ((fix.stamp_ns / 200'000'000) % 2 == 0) {
      bad_fix.spoil(fix);
      ++bad;
    }
    return true;
  });
  EXPECT_EQ(count_of(spoilt.status, reason), static_cast<std::uint64_t>(bad));
  EXPECT_LT(spoilt.error_m(), kRtkTolerance_m);
  EXPECT_EQ(spoilt.status.reset.counter, 1U) << "the one of the first heading";
}

INSTANTIATE_TEST_SUITE_P(
    TableE,
    BadFixes,
    testing::Combine(
        testing::Values("ekf15", "eskf18"),
        testing::Values(
            BadFix{"not_finite", [](GnssFix& f) { f.latitude_deg = kNaN; }},
            BadFix{"not_finite",
                   [](GnssFix& f) { f.altitude_m = std::numeric_limits<double>::infinity(); }},
            BadFix{"covariance_not_finite", [](GnssFix& f) { f.covariance_enu_m2(2, 2) = kNaN; }},
            BadFix{"covariance_huge", [](GnssFix& f) { f.covariance_enu_m2(0, 0) = 1.7e308; }},
            BadFix{"used_with_default_covariance",
                   [](GnssFix& f) { f.covariance_enu_m2.setZero(); }},
            BadFix{"used_with_default_covariance",
                   [](GnssFix& f) { f.covariance_enu_m2(1, 1) = -4.0; }},
            BadFix{"used_with_diagonal_covariance",
                   [](GnssFix& f) { f.covariance_enu_m2(0, 1) = f.covariance_enu_m2(1, 0) = 5.0; }},
            BadFix{"out_of_range", [](GnssFix& f) { f.latitude_deg = -2e10; }},
            BadFix{"out_of_range", [](GnssFix& f) { f.longitude_deg += 360.0; }},
            BadFix{"zero_position", [](GnssFix& f) { f.latitude_deg = f.longitude_deg = 0.0; }},
            BadFix{"no_fix", [](GnssFix& f) { f.status = FixStatus::kNoFix; }},
            BadFix{"stamp_out_of_range",
                   [](GnssFix& f) { f.stamp_ns = std::numeric_limits<Nanoseconds>::min(); }},
            BadFix{"future_stamp", [](GnssFix& f) { f.stamp_ns += 3600 * kNanosecondsPerSecond; }},
            BadFix{"too_old", [](GnssFix& f) { f.stamp_ns -= 60 * kNanosecondsPerSecond; }},
            BadFix{"gate", [](GnssFix& f) { f.latitude_deg += 3.0 / 111'200.0; }},
            BadFix{"teleport", [](GnssFix& f) { f.latitude_deg += 700.0 / 111'200.0; }, "gate"})));

TEST(BadInputs, uses_only_the_horizontal_part_when_the_height_is_off) {
  Driven driven;
  driven.advance(22.0, [](GnssFix& fix) {
    fix.altitude_m += 10.0;
    return true;
  });
  EXPECT_GT(count_of(driven.status, "used_without_height"), 5U);
  EXPECT_LT(driven.error_m(), 1.0);
}

TEST(BadInputs, does_not_stay_locked_out) {
  Driven driven;
  const auto shift = [](GnssFix& fix) {
    fix.latitude_deg += 20.0 / 111'200.0;
    return true;
  };
  driven.advance(24.0, shift);
  EXPECT_LT(driven.error_m(), 2.0) << "a few seconds of contradiction are not believed";
  driven.advance(27.0, shift);
  EXPECT_NEAR(driven.error_m(), 20.0, 1.0);
  EXPECT_EQ(count_of(driven.status, "recovered"), 1U);
  EXPECT_EQ(driven.status.reset.counter, 2U);
  EXPECT_NEAR(driven.status.reset.delta.p.y(), 20.0, 2.0);
  EXPECT_GT(std::sqrt(driven.odometry.pose_covariance(1, 1)), 3.0)
      << "half of the disagreement is remembered";
}

TEST(BadInputs, refuses_a_receiver_that_repeats_itself_while_moving) {
  Driven driven;
  GnssFix first;
  driven.advance(23.0, [&](GnssFix& fix) {
    if (first.stamp_ns == 0) {
      first = fix;
    }
    fix.latitude_deg = first.latitude_deg;
    fix.longitude_deg = first.longitude_deg;
    fix.altitude_m = first.altitude_m;
    return true;
  });
  EXPECT_GT(count_of(driven.status, "frozen"), 8U);
}

// ---- bad IMU ------------------------------------------------------------------------------------

TEST(BadInputs, survives_imu_samples_that_are_not_finite) {
  Driven driven;
  for (Input& input : driven.inputs) {
    if (!input.is_fix && input.available_s > 20.0 && (input.imu.stamp_ns / 10'000'000) % 3 == 0) {
      input.imu.accel_mps2.x() = kNaN;
    }
  }
  driven.advance(30.0);
  EXPECT_GT(count_of(driven.status, "imu_not_finite"), 300U);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(BadInputs, bridges_a_gap_of_the_imu_with_a_wider_covariance) {
  Driven driven;
  const double before = std::sqrt(driven.odometry.pose_covariance(0, 0));
  std::erase_if(driven.inputs, [](const Input& input) {
    return input.available_s > 20.0 && input.available_s < 20.9;
  });
  driven.advance(20.91);  // before the next fix is delivered
  EXPECT_GT(std::sqrt(driven.odometry.pose_covariance(0, 0)), 2.0 * before);
  EXPECT_LT(driven.error_m(),
            3.0 * std::sqrt(driven.odometry.pose_covariance.diagonal().head<3>().sum()));
  driven.advance(30.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(BadInputs, is_stale_when_the_imu_falls_silent_and_comes_back_with_it) {
  Driven driven;
  std::erase_if(driven.inputs, [](const Input& input) {
    return !input.is_fix && input.available_s > 20.0 && input.available_s < 23.0;
  });
  driven.advance(22.9);
  EXPECT_EQ(driven.status.health, GpsHealth::kStale);
  EXPECT_GT(count_of(driven.status, "future_stamp"), 5U);
  driven.advance(45.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(BadInputs, starts_anew_when_the_imu_clock_moves) {
  Driven driven;
  for (Input& input : driven.inputs) {
    input.imu.stamp_ns += input.available_s > 20.0 ? 3600 * kNanosecondsPerSecond : 0;
    input.fix.stamp_ns += input.available_s > 20.0 ? 3600 * kNanosecondsPerSecond : 0;
  }
  const Nanoseconds before_ns = driven.odometry.stamp_ns;
  driven.advance(23.0);
  EXPECT_TRUE(has_event(driven.events, "imu_clock_reset"));
  EXPECT_GT(driven.odometry.stamp_ns, before_ns + 3600 * kNanosecondsPerSecond);
  EXPECT_EQ(driven.status.datum_id, test_datum().id());
}

TEST(BadInputs, is_at_fault_with_an_imu_in_g) {
  Sensors sensors = rtk_robot();
  const auto truth = drive(town(1.5, 3.0), 10.0);
  auto inputs = sense(truth, sensors, 1);
  for (Input& input : inputs) {
    input.imu.accel_mps2 /= 9.80665;
  }
  GpsOdometry filter(config_with_datum(), sensors.robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_TRUE(result.odometry.empty());
  EXPECT_EQ(result.statuses.back().health, GpsHealth::kFault);
  EXPECT_TRUE(has_event(result.events, "imu_units_g"));
}

// ---- before anything
// --------------------------------------------------------------------------------

TEST(BadInputs, is_not_poisoned_by_a_fix_from_the_future_before_the_first_imu_sample) {
  const auto truth = drive(town(1.5, 3.0), 30.0);
  GpsOdometry filter(config_with_datum(), rtk_robot().robot);
  EXPECT_EQ(count_of(*filter.on_fix(fix_at({0.0, 0.0, 0.0}, 1e6, 0.014)).status, "before_imu"), 1U);
  const Recorded result = run(filter, sense(truth, rtk_robot(), 1), truth);
  EXPECT_LT(rms_m(result.samples, 15.0), kRtkTolerance_m);
  EXPECT_NEAR(to_seconds(result.statuses.back().stamp_ns - kEpoch_ns), 30.0, 0.1);
}

// ---- anything -----------------------------------------------------------------------------------

TEST(BadInputs, lets_no_random_input_out_as_anything_but_finite_and_positive) {
  std::mt19937_64 random(7);
  const double odd[] = {
      0.0, -1.0, 1.0, 1e-300, 1e300, kNaN, std::numeric_limits<double>::infinity(), 90.0, 180.0};
  const auto chance = [&](double p) {
    return std::uniform_real_distribution<double>(0.0, 1.0)(random) < p;
  };
  const auto any = [&] { return odd[random() % std::size(odd)]; };
  for (int round = 0; round < 20; ++round) {
    Driven driven(round < 10 ? "ekf15" : "eskf18");
    Nanoseconds last_ns = driven.odometry.stamp_ns;
    for (; driven.next < driven.inputs.size() && driven.inputs[driven.next].available_s < 40.0;
         ++driven.next) {
      Input input = driven.inputs[driven.next];
      if (chance(0.2)) {
        input.imu.gyro_radps(static_cast<int>(random() % 3)) = any();
        input.imu.accel_mps2(static_cast<int>(random() % 3)) = any();
        input.fix.covariance_enu_m2(static_cast<int>(random() % 3),
                                    static_cast<int>(random() % 3)) = any();
        double* place[] = {
            &input.fix.latitude_deg, &input.fix.longitude_deg, &input.fix.altitude_m};
        *place[random() % 3] = any();
      }
      if (chance(0.02)) {
        input.imu.stamp_ns += static_cast<Nanoseconds>(random() % 2'000'000'000) - 1'000'000'000;
        input.fix.stamp_ns =
            chance(0.1) ? std::numeric_limits<Nanoseconds>::max() : input.imu.stamp_ns;
      }
      const Output output =
          input.is_fix ? driven.filter.on_fix(input.fix) : driven.filter.on_imu(input.imu);
      if (output.odometry) {
        ASSERT_TRUE(output.odometry->T_frame_child.is_finite());
        ASSERT_TRUE(output.odometry->pose_covariance.allFinite());
        ASSERT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(output.odometry->pose_covariance)
                      .eigenvalues()(0),
                  0.0);
        ASSERT_GT(output.odometry->stamp_ns, last_ns);
        last_ns = output.odometry->stamp_ns;
      }
      if (output.status) {
        ASSERT_TRUE(output.status->accepted_antenna_map_m.allFinite());
        ASSERT_TRUE(output.status->accepted_covariance_map_m2.allFinite());
      }
    }
  }
}

}  // namespace
}  // namespace trigpoint::gps_odometry
