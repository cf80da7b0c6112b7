// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clock_offset.hpp"

#include "driven.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace trigpoint::gps_odometry {
namespace {

constexpr Nanoseconds kHour_ns = 3600 * kNanosecondsPerSecond;
constexpr double kRecovery_s = 3.0;

// ---- the estimator by itself --------------------------------------------------------------------

/// Fixes at 5 Hz whose clock is `offset_s` ahead, `latency_s` late, from one second to another.
struct Clocks {
  ClockOffset offset{Config{}};
  double latency_s{0.12};
  ClockVerdict last;

  void run(double from_s, double to_s, double offset_s) {
    for (int i = 0; from_s + 0.2 * i < to_s; ++i) {
      const double epoch_s = from_s + 0.2 * i;
      last = offset.place(stamp_of(epoch_s + offset_s), stamp_of(epoch_s + latency_s));
    }
  }
};

TEST(ClockOffset, leaves_stamps_of_one_clock_alone_at_any_latency) {
  for (const double latency_s : {0.0, 0.06, 0.3, 0.5, 0.99}) {
    ClockOffset offset{Config{}};
    for (int i = 0; i < 100; ++i) {
      const Nanoseconds stamp_ns = stamp_of(0.2 * i);
      const double jitter_s = latency_s * (i % 3) / 2.0;
      const ClockVerdict verdict = offset.place(stamp_ns, stamp_ns + from_seconds(jitter_s));
      ASSERT_EQ(verdict.stamp_ns, stamp_ns);
      ASSERT_FALSE(verdict.event);
    }
    EXPECT_EQ(offset.stamp_sigma_s(), 0.0);
  }
}

TEST(ClockOffset, does_not_take_a_slow_link_for_another_clock) {
  Clocks clocks;
  clocks.latency_s = 2.0;
  clocks.run(0.0, 20.0, 0.0);
  EXPECT_FALSE(clocks.offset.is_estimated());
}

TEST(ClockOffset, is_found_within_the_latency_that_it_cannot_see) {
  for (const double truth_s : {3600.0, -3600.0, 18.0, -37.0, 1.0, 1.7e9}) {
    Clocks clocks;
    clocks.run(0.0, 5.0, truth_s);
    ASSERT_TRUE(clocks.offset.is_estimated());
    EXPECT_NEAR(to_seconds(clocks.offset.offset_ns()), truth_s, 2.0 * 0.05) << truth_s;
    EXPECT_GT(clocks.offset.stamp_sigma_s(), 0.0);
  }
}

TEST(ClockOffset, follows_the_fix_that_arrived_soonest) {
  ClockOffset offset{Config{}};
  for (int i = 0; i < 200; ++i) {
    // Latencies from 0.1 to 0.4 s: the least is what the estimate rests on.
    const double latency_s = 0.1 + 0.3 * std::abs(std::sin(1.7 * i));
    offset.place(stamp_of(0.2 * i + 3600.0), stamp_of(0.2 * i + latency_s));
  }
  EXPECT_NEAR(to_seconds(offset.offset_ns()), 3600.0, 0.02);
}

TEST(ClockOffset, follows_the_drift_of_the_clocks) {
  ClockOffset offset{Config{}};
  constexpr double kDrift = -200e-6;
  for (int i = 0; i < 5000; ++i) {
    const double t = 0.2 * i;
    offset.place(stamp_of(t + 3600.0 + kDrift * t), stamp_of(t + 0.1));
  }
  EXPECT_NEAR(to_seconds(offset.offset_ns()), 3600.0 + kDrift * 1000.0, 0.02);
}

TEST(ClockOffset, goes_back_to_one_clock) {
  Clocks clocks;
  clocks.run(0.0, 5.0, 3600.0);
  clocks.run(5.0, 10.0, 0.0);
  EXPECT_FALSE(clocks.offset.is_estimated());
  EXPECT_EQ(clocks.last.stamp_ns, stamp_of(9.8));
}

TEST(ClockOffset, refuses_single_fixes_of_another_clock) {
  Clocks clocks;
  clocks.run(0.0, 5.0, 3600.0);
  EXPECT_EQ(clocks.offset.place(stamp_of(5.0), stamp_of(5.1)).reason, "clock_jump");
  clocks.run(5.2, 6.0, 3600.0);
  EXPECT_TRUE(clocks.last.stamp_ns);
}

TEST(ClockOffset, tells_how_far_a_clock_has_moved_also_over_centuries) {
  constexpr Nanoseconds kFar_ns = 7'000'000'000 * kNanosecondsPerSecond;
  ClockOffset offset{Config{}};
  for (int i = 0; i < 10; ++i) {
    offset.place(kFar_ns + stamp_of(0.2 * i) - stamp_of(0.0), from_seconds(0.2 * i));
  }
  ASSERT_TRUE(offset.is_estimated());
  const ClockVerdict verdict = offset.place(0, kFar_ns);
  EXPECT_EQ(verdict.reason, "clock_jump");
  EXPECT_NE(verdict.text.find("its clock is -14000000000"), std::string::npos) << verdict.text;
  EXPECT_FALSE(verdict.is_ahead);
}

TEST(ClockOffset, refuses_a_stamp_that_it_heard_before) {
  Clocks clocks;
  clocks.run(0.0, 5.0, 3600.0);
  const Nanoseconds stamp_ns = stamp_of(3605.0);
  EXPECT_TRUE(clocks.offset.place(stamp_ns, stamp_of(5.1)).stamp_ns);
  EXPECT_EQ(clocks.offset.place(stamp_ns, stamp_of(5.15)).reason, "duplicate_stamp");
}

TEST(ClockOffset, is_not_found_from_an_imu_that_stands_still) {
  ClockOffset offset{Config{}};
  for (int i = 0; i < 50; ++i) {
    offset.place(stamp_of(10.0 + 0.2 * i), stamp_of(9.0));
  }
  EXPECT_FALSE(offset.is_estimated());
}

TEST(ClockOffset, is_not_found_from_a_frozen_clock) {
  ClockOffset offset{Config{}};
  for (int i = 0; i < 50; ++i) {
    offset.place(stamp_of(3600.0), stamp_of(0.2 * i));
  }
  EXPECT_FALSE(offset.is_estimated());
}

// ---- the whole filter ---------------------------------------------------------------------------

class ClockSteps : public testing::TestWithParam<std::tuple<const char*, double>> {};

TEST_P(ClockSteps, of_the_fixes_are_told_and_fixes_are_used_again_within_three_seconds) {
  const auto& [filter, step_s] = GetParam();
  Driven driven(filter);
  const auto step = [&, shift_ns = from_seconds(step_s)](GnssFix& fix) {
    fix.stamp_ns += shift_ns;
    return true;
  };
  driven.advance(20.0 + kRecovery_s, step);
  EXPECT_TRUE(has_event(driven.events, "gnss_clock_moved"));
  EXPECT_TRUE(has_event(driven.events, "gnss_clock_known"));
  EXPECT_LT(to_seconds(driven.odometry.stamp_ns - driven.status.last_accepted_fix_ns), 0.5);
  driven.advance(45.0, step);
  // The latency is known to 0.05 s: 0.075 m at 1.5 m/s.
  EXPECT_LT(driven.error_m(), kRtkTolerance_m + 0.1);
  const double sigma_m = std::sqrt(driven.odometry.pose_covariance.diagonal().head<2>().sum());
  EXPECT_LT(driven.error_m(), 3.0 * sigma_m);
  EXPECT_EQ(driven.status.reset.counter, 1U) << "the one of the first heading";
}

INSTANTIATE_TEST_SUITE_P(
    Forth_and_back,
    ClockSteps,
    testing::Combine(testing::Values("ekf15", "eskf18"),
                     testing::Values(3600.0, -3600.0, -10.0, 1.0, -1.0, 18.0)));

class Clock : public testing::TestWithParam<const char*> {};

TEST_P(Clock, of_the_imu_alone_may_move_by_an_hour) {
  Driven driven(GetParam());
  for (Input& input : driven.inputs) {
    input.imu.stamp_ns += input.available_s > 20.0 ? kHour_ns : 0;
  }
  driven.advance(20.0 + kRecovery_s);
  EXPECT_TRUE(has_event(driven.events, "imu_clock_reset"));
  EXPECT_TRUE(has_event(driven.events, "gnss_clock_known"));
  EXPECT_GT(driven.status.last_accepted_fix_ns, stamp_of(20.0) + kHour_ns);
}

TEST_P(Clock, of_both_may_go_back_by_ten_seconds) {
  Driven driven(GetParam());
  for (Input& input : driven.inputs) {
    input.imu.stamp_ns -= input.available_s > 20.0 ? 10 * kNanosecondsPerSecond : 0;
    input.fix.stamp_ns -= input.available_s > 20.0 ? 10 * kNanosecondsPerSecond : 0;
  }
  driven.advance(20.0 + kRecovery_s);
  EXPECT_TRUE(has_event(driven.events, "imu_clock_reset"));
  EXPECT_NEAR(to_seconds(driven.status.last_accepted_fix_ns - kEpoch_ns), 13.0, 1.0);
  // Position by the fixes again; which way it points is open until it has moved.
  const auto index = static_cast<std::size_t>(1000.0 * (driven.time_s() + 10.0));
  const double error_m =
      (driven.odometry.T_frame_child.p - driven.truth.at(index).position_map_m).norm();
  EXPECT_LT(error_m, 3.0 * std::sqrt(driven.odometry.pose_covariance.diagonal().head<3>().sum()));
}

TEST_P(Clock, that_goes_back_takes_no_doubt_of_a_time_to_come_with_it) {
  Driven driven(GetParam());
  constexpr double kAway_deg = 50.0 / 111'000.0;
  for (Input& input : driven.inputs) {
    // Silent, then somewhere else: followed, and doubted for 30 s.
    input.fix.latitude_deg += input.available_s > 26.0 ? kAway_deg : 0.0;
    input.imu.stamp_ns -= input.available_s > 35.0 ? kHour_ns : 0;
    input.fix.stamp_ns -= input.available_s > 35.0 ? kHour_ns : 0;
  }
  driven.advance(35.0, [&](const GnssFix& fix) { return fix.stamp_ns > stamp_of(25.9); });
  ASSERT_EQ(driven.status.health, GpsHealth::kDegraded);
  ASSERT_GT(driven.odometry.pose_covariance(1, 1), 100.0) << "doubted";
  driven.advance(60.0);
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
  EXPECT_LT(driven.odometry.pose_covariance(1, 1), 1.0);
}

TEST_P(Clock, that_freezes_costs_the_fixes_of_that_time) {
  Driven driven(GetParam());
  const Nanoseconds frozen_ns = stamp_of(20.0);
  driven.advance(22.0, [&](GnssFix& fix) {
    fix.stamp_ns = std::min(fix.stamp_ns, frozen_ns);
    return true;
  });
  EXPECT_GT(count_of(driven.status, "duplicate_stamp"), 3U);
  driven.advance(22.0 + kRecovery_s);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
}

TEST_P(Clock, of_another_time_scale_from_the_start_gives_an_honest_position) {
  const auto truth = drive(town(5.0, 3.0), 60.0);
  auto inputs = sense(truth, rtk_robot(), 4);
  for (Input& input : inputs) {
    input.fix.stamp_ns += 18 * kNanosecondsPerSecond;  // GPS time
  }
  GpsOdometry filter(config_with_datum(GetParam()), rtk_robot().robot);
  const Recorded result = run(filter, inputs, truth);
  ASSERT_FALSE(result.samples.empty());
  int inside = 0;
  int count = 0;
  for (const Sample& sample : result.samples) {
    if (sample.time_s > 30.0) {
      ++count;
      inside += sample.error_m.head<2>().norm() < 3.0 * sample.sigma_m.head<2>().norm() ? 1 : 0;
    }
  }
  EXPECT_GT(inside, 0.95 * count);
  EXPECT_LT(rms_m(result.samples, 30.0), 0.5) << "0.05 s at 5 m/s, and what turns make of it";
}

TEST_P(Clock, that_is_one_gives_the_same_bits_whatever_is_assumed_of_others) {
  const auto truth = drive(town(1.5, 3.0), 40.0);
  Sensors sensors = rtk_robot();
  for (const double latency_s : {0.06, 0.5}) {
    sensors.latency_s = latency_s;
    const auto inputs = sense(truth, sensors, 5);
    Config other = config_with_datum(GetParam());
    other.clock_latency_s = 0.4;
    other.clock_latency_sigma_s = 10.0;
    other.clock_latest_s = 1.0;
    GpsOdometry first(config_with_datum(GetParam()), sensors.robot);
    GpsOdometry second(other, sensors.robot);
    const Recorded one = run(first, inputs, truth);
    const Recorded two = run(second, inputs, truth);
    ASSERT_EQ(one.odometry.size(), two.odometry.size());
    ASSERT_FALSE(one.odometry.empty());
    EXPECT_EQ(one.odometry.back().T_frame_child.p, two.odometry.back().T_frame_child.p);
    EXPECT_EQ(one.odometry.back().pose_covariance, two.odometry.back().pose_covariance);
    EXPECT_FALSE(has_event(one.events, "gnss_clock_known"));
  }
}

/// Later than a clock may seem to be off, but their stamps go on.
TEST_P(Clock, is_not_doubted_for_fixes_that_come_late_behind_newer_ones) {
  const auto truth = drive(town(1.5, 3.0), 40.0);
  Sensors sensors = rtk_robot();
  sensors.latency_s = 0.63;
  auto inputs = sense(truth, sensors, 5);
  int fixes = 0;
  for (Input& input : inputs) {
    if (input.is_fix) {
      input.available_s += ++fixes % 3 == 0 ? 0.45 : 0.0;
    }
  }
  std::stable_sort(inputs.begin(), inputs.end(), [](const Input& a, const Input& b) {
    return a.available_s < b.available_s;
  });
  GpsOdometry filter(config_with_datum(GetParam()), sensors.robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_FALSE(has_event(result.events, "gnss_clock_moved"));
  EXPECT_GT(filter.status().fixes_accepted + 10U, filter.status().fixes_received);
}

TEST(ClockOffset, takes_a_fix_that_fills_a_gap_for_late_and_not_for_another_clock) {
  Clocks clocks;
  clocks.run(0.0, 20.0, 0.0);
  // That of 20.0 s is missing and comes behind 20.8 s; stamps that were there, or lie anywhere
  // between, are those of a clock that went back.
  clocks.run(20.2, 21.0, 0.0);
  ClockOffset was_there = clocks.offset;
  ClockOffset between = clocks.offset;
  EXPECT_EQ(clocks.offset.place(stamp_of(20.0), stamp_of(21.2)).stamp_ns, stamp_of(20.0));
  EXPECT_EQ(was_there.place(stamp_of(19.8), stamp_of(21.2)).reason, "clock_jump");
  EXPECT_EQ(between.place(stamp_of(19.9), stamp_of(21.2)).reason, "clock_jump");
  // A copy that comes as late does not make one of it.
  EXPECT_EQ(was_there.place(stamp_of(20.0), stamp_of(21.25)).stamp_ns, stamp_of(20.0));
}

INSTANTIATE_TEST_SUITE_P(Filters, Clock, testing::Values("ekf15", "eskf18"));

}  // namespace
}  // namespace trigpoint::gps_odometry
