// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clock_offset.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::lio_mapper {

namespace {

constexpr double kScan_s = 0.1;
constexpr double kImu_s = 0.005;
constexpr double kAttitudeNoise_rad = 3e-4;
constexpr Nanoseconds kClockEpoch_ns = 1'000'000'000'000;

/// A robot that turns to and fro and nods; `turns` false: it stands.
Eigen::Quaterniond attitude(double t, bool turns) {
  if (!turns) {
    return Eigen::Quaterniond::Identity();
  }
  return from_yaw(0.8 * std::sin(0.6 * t)) *
         so3_exp({0.01 * std::sin(7.0 * t), 0.008 * std::cos(5.0 * t), 0.0});
}

std::optional<ClockOffset> estimate_after(double duration_s,
                                          double offset_s,
                                          unsigned seed,
                                          bool turns = true) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  ClockOffsetEstimator estimator;
  AttitudeWindows windows;
  ImuBuffer imu;
  const Eigen::Vector3d bias{0.002, -0.003, 0.004};
  int next_imu = -20;
  for (int scan = 1; scan * kScan_s < duration_s; ++scan) {
    const double now_s = scan * kScan_s;
    for (; next_imu * kImu_s <= now_s + kImu_s; ++next_imu) {
      const double t = next_imu * kImu_s;
      const double h = 1e-5;
      const Eigen::Vector3d rate =
          so3_log(attitude(t - h, turns).conjugate() * attitude(t + h, turns)) / (2.0 * h);
      imu.push({kClockEpoch_ns + from_seconds(t), rate + bias, Eigen::Vector3d::Zero()});
    }
    const Eigen::Vector3d noise{normal(random), normal(random), normal(random)};
    estimator.add(
        windows.add(kClockEpoch_ns + from_seconds(now_s),
                    attitude(now_s + offset_s, turns) * so3_exp(kAttitudeNoise_rad * noise),
                    Eigen::Vector3d::Zero(),
                    imu));
    imu.forget_before(kClockEpoch_ns + from_seconds(now_s));
  }
  return estimator.estimate();
}

TEST(ClockOffsetEstimator, finds_the_offset_within_what_it_states) {
  for (const double offset_s : {-0.03, -0.005, 0.0, 0.012, 0.03}) {
    double nees = 0.0;
    constexpr int kRuns = 8;
    for (unsigned seed = 1; seed <= kRuns; ++seed) {
      const auto found = estimate_after(60.0, offset_s, seed);
      ASSERT_TRUE(found.has_value());
      EXPECT_LT(found->sigma_s, 1e-3);
      EXPECT_NEAR(found->offset_s, offset_s, 1e-3);
      nees += std::pow((found->offset_s - offset_s) / found->sigma_s, 2.0) / kRuns;
    }
    EXPECT_LT(nees, 3.3) << offset_s;  // chi-square of 8, 0.1 %
  }
}

TEST(ClockOffsetEstimator, says_nothing_while_nothing_turns) {
  EXPECT_FALSE(estimate_after(60.0, 0.03, 1, false).has_value());
}

TEST(ClockOffsetEstimator, says_nothing_before_it_has_seen_several_windows) {
  EXPECT_FALSE(estimate_after(10.0, 0.03, 1).has_value());
}

}  // namespace

}  // namespace trigpoint::lio_mapper
