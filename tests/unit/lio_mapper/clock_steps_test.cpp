// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clock_steps.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>

namespace trigpoint::lio_mapper {

namespace {

using Verdict = ClockSteps::Verdict;

constexpr double kTurn_s = 0.1;
constexpr double kBegin_s = 1000.0;

struct Cloud {
  double shift_s{0.0};         ///< of its stamp
  double points_shift_s{0.0};  ///< of its points' times
  double late_s{0.0};          ///< arrives so much later than others
  double imu_late_s{0.0};      ///< and the IMU's samples
  bool lost{false};
};

struct Seen {
  int doubtful{0};
  int stepped{0};
  double offset_s{0.0};
  int first_stepped{-1};
};

/// `count` clouds, arriving 30 ms after their sweep's end with jitter, IMU at 100 Hz.
Seen look_at(int count, const std::function<Cloud(int)>& cloud_of, double jitter_s = 0.004) {
  ClockSteps steps;
  std::mt19937 random(7);
  std::normal_distribution<double> jitter(0.0, jitter_s);
  Seen seen;
  for (int i = 0; i < count; ++i) {
    const Cloud cloud = cloud_of(i);
    const double taken_s = kBegin_s + kTurn_s * i;
    const double arrives_s = taken_s + kTurn_s + 0.03 + std::abs(jitter(random)) + cloud.late_s;
    const double imu_s = std::floor((arrives_s - cloud.imu_late_s) * 100.0) / 100.0;
    if (cloud.lost) {
      continue;
    }
    const double stamp_s = taken_s + cloud.shift_s;
    const Verdict verdict = steps.look(from_seconds(stamp_s),
                                       from_seconds(taken_s + kTurn_s + cloud.points_shift_s),
                                       from_seconds(imu_s));
    seen.doubtful += verdict == Verdict::kDoubtful ? 1 : 0;
    if (verdict == Verdict::kStepped) {
      seen.first_stepped = seen.stepped++ == 0 ? i : seen.first_stepped;
    }
  }
  seen.offset_s = to_seconds(steps.offset_ns());
  return seen;
}

Cloud shifted(double shift_s) {
  Cloud cloud;
  cloud.shift_s = shift_s;
  cloud.points_shift_s = shift_s;
  return cloud;
}

class ClockStepOf : public testing::TestWithParam<double> {};

TEST_P(ClockStepOf, is_found_by_the_second_cloud_and_taken_back) {
  const double step_s = GetParam();
  const Seen there = look_at(30, [&](int i) { return shifted(i < 20 ? 0.0 : step_s); });
  EXPECT_EQ(there.doubtful, 1);
  EXPECT_EQ(there.stepped, 1);
  EXPECT_EQ(there.first_stepped, 21);
  EXPECT_NEAR(there.offset_s, -step_s, 1e-6);
  const Seen back = look_at(60, [&](int i) { return shifted(i >= 20 && i < 40 ? step_s : 0.0); });
  EXPECT_EQ(back.stepped, 2);
  EXPECT_NEAR(back.offset_s, 0.0, 1e-6);
}

// Steps by a few turns forward look like lost clouds while the IMU is late.
INSTANTIATE_TEST_SUITE_P(Steps,
                         ClockStepOf,
                         testing::Values(-3600.0, -0.25, -0.3, -0.08, -0.03, 0.04, 0.25, 3600.0));

TEST(ClockSteps, lost_late_doubled_and_swapped_clouds_are_none) {
  const auto expect_none = [](const char* what, int doubtful, const Seen& seen) {
    EXPECT_EQ(seen.stepped, 0) << what;
    EXPECT_LE(seen.doubtful, doubtful) << what;
    EXPECT_EQ(seen.offset_s, 0.0) << what;
  };
  const auto with = [](const std::function<void(int, Cloud&)>& change) {
    return look_at(100, [&](int i) {
      Cloud cloud;
      change(i, cloud);
      return cloud;
    });
  };
  std::mt19937 random(3);
  expect_none("lost", 0, with([&](int, Cloud& c) { c.lost = random() % 4 == 0; }));
  expect_none("late", 0, with([](int i, Cloud& c) { c.late_s = i % 30 > 24 ? 0.25 : 0.0; }));
  expect_none("late and lost", 0, with([](int i, Cloud& c) {
                c.late_s = i % 30 > 24 ? 0.31 : 0.0;
                c.lost = i % 30 > 18 && i % 30 < 25;
              }));
  expect_none(
      "IMU stalls", 0, with([](int i, Cloud& c) { c.imu_late_s = i / 10 % 3 ? 0.0 : 0.4; }));
  expect_none("IMU stalls and clouds are lost", 0, with([](int i, Cloud& c) {
                c.imu_late_s = i % 30 > 19 && i % 30 < 24 ? 0.1 : 0.0;
                c.lost = i % 30 == 20;
              }));
  // A cloud that comes twice, two turns late.
  expect_none("old", 10, with([](int i, Cloud& c) {
                const bool old = i % 10 == 9;
                c.shift_s = c.points_shift_s = old ? -0.2 : 0.0;
              }));
  // The last point that hits something ends the sweep.
  expect_none(
      "short sweeps", 0, with([](int i, Cloud& c) { c.points_shift_s = i > 50 ? -0.04 : 0.0; }));
  // Stamped by the host as they arrive, points by the scanner.
  expect_none("other clock", 0, with([](int i, Cloud& c) { c.shift_s = i > 50 ? 0.25 : 0.0; }));
}

/// The LiDAR counts from its start until its clock is told the time.
TEST(ClockSteps, a_clock_that_is_told_the_time_was_never_the_imus) {
  const Seen seen = look_at(60, [](int i) { return shifted(i < 30 ? -1.7e6 : 0.0); });
  EXPECT_EQ(seen.stepped, 0);
  EXPECT_EQ(seen.offset_s, 0.0);
}

/// A driver that is started again with a right clock.
TEST(ClockSteps, a_correction_ends_where_stamps_are_right_again_after_a_pause) {
  const Seen seen = look_at(90, [](int i) {
    Cloud cloud = shifted(i >= 20 && i < 40 ? -0.25 : 0.0);
    cloud.lost = i >= 40 && i < 60;
    return cloud;
  });
  EXPECT_EQ(seen.stepped, 2);
  EXPECT_EQ(seen.offset_s, 0.0);
}

/// Without a rhythm there is nothing to go by.
TEST(ClockSteps, judges_nothing_without_a_rhythm) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-0.02, 0.02);
  const Seen seen =
      look_at(100, [&](int i) { return shifted(any(random) + (i > 60 ? -0.25 : 0.0)); });
  EXPECT_EQ(seen.stepped, 0);
  EXPECT_EQ(seen.doubtful, 0);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
