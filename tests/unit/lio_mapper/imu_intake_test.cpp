// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_intake.hpp"

#include <gtest/gtest.h>

namespace trigpoint::lio_mapper {
namespace {

constexpr double kMaxGap_s = 0.1;

/// Samples let in of three seconds at 100 Hz in which the gyro says `yaw_rate`.
int let_in(ImuIntake& intake, double yaw_rate, double from_s, Events& events) {
  int count = 0;
  for (int i = 0; i < 300; ++i) {
    ImuSample sample;
    sample.stamp_ns = from_seconds(from_s + 0.01 * i);
    sample.gyro_radps = {0.0, 0.0, yaw_rate};
    sample.accel_mps2 = {0.0, 0.0, 9.81};
    count += intake.accept(sample, kMaxGap_s, events) ? 1 : 0;
  }
  return count;
}

TEST(ImuIntake, lets_a_turn_in_place_at_90_degrees_a_second_in) {
  ImuIntake intake(Eigen::Quaterniond::Identity());
  Events events;
  EXPECT_EQ(let_in(intake, 1.5708, 10.0, events), 300);
  EXPECT_TRUE(events.empty());
}

TEST(ImuIntake, refuses_a_gyro_in_degrees_for_good_and_names_the_remedy) {
  ImuIntake intake(Eigen::Quaterniond::Identity());
  Events events;
  EXPECT_LT(let_in(intake, 17.2, 10.0, events), 150);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.front().code, "imu_gyro_in_degrees");
  EXPECT_EQ(events.front().severity, Severity::kError);
  EXPECT_NE(events.front().text.find("0.0174533"), std::string::npos) << events.front().text;
  EXPECT_EQ(let_in(intake, 0.0, 13.0, events), 0) << "it has not changed its unit";
}

}  // namespace
}  // namespace trigpoint::lio_mapper
