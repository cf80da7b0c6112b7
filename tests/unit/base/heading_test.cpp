// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/heading.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace trigpoint {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

YawMeasurement good_yaw(double yaw_rad = 0.3) {
  return {from_seconds(1.0), "", from_yaw(yaw_rad), 0.01};
}

TEST(CheckHeading, refuses_what_is_no_heading_by_name) {
  const auto reason = [](auto spoil) {
    YawMeasurement yaw = good_yaw();
    spoil(yaw);
    const auto verdict = check_heading(yaw, RobotConfig{});
    EXPECT_FALSE(verdict.measurement);
    return verdict.reason;
  };
  EXPECT_EQ(reason([](YawMeasurement& y) { y.q_world_base.reset(); }), "yaw_without_orientation");
  EXPECT_EQ(reason([](YawMeasurement& y) { y.q_world_base->coeffs().setZero(); }),
            "yaw_without_orientation");
  EXPECT_EQ(reason([](YawMeasurement& y) { y.q_world_base->coeffs() *= 1.2; }), "yaw_not_unit");
  EXPECT_EQ(reason([](YawMeasurement& y) { y.q_world_base->x() = kNotANumber; }), "yaw_not_finite");
  EXPECT_EQ(reason([](YawMeasurement& y) { y.variance_rad2 = kNotANumber; }), "yaw_not_finite");
  EXPECT_EQ(reason([](YawMeasurement& y) { y.variance_rad2 = 1e9; }), "yaw_unknown");
  EXPECT_EQ(reason([](YawMeasurement& y) { y.stamp_ns = -5; }), "yaw_stamp_out_of_range");
}

TEST(CheckHeading, normalises_adds_the_offset_and_knows_a_floor) {
  RobotConfig robot;
  robot.yaw_offset_rad = -0.2;
  YawMeasurement yaw = good_yaw();
  yaw.q_world_base->coeffs() *= 1.02;
  yaw.variance_rad2 = 1e-12;
  const auto verdict = check_heading(yaw, robot);
  ASSERT_TRUE(verdict.measurement);
  EXPECT_NEAR(verdict.measurement->yaw_map_rad, 0.1, 1e-9);
  EXPECT_EQ(verdict.measurement->sigma_rad, robot.yaw_floor_sigma_rad);
  yaw.variance_rad2 = 0.0;
  EXPECT_EQ(check_heading(yaw, robot).measurement->sigma_rad, robot.yaw_default_sigma_rad);
}

}  // namespace
}  // namespace trigpoint
