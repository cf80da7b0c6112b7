// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/convert.hpp"

#include "samples.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace trigpoint::bus {
namespace {

using ::testing::ElementsAre;

TEST(Stamps, are_rounded_down_so_that_nanosec_is_never_negative) {
  const auto stamp = to_message(Nanoseconds{-1});
  EXPECT_EQ(stamp.sec(), -1);
  EXPECT_EQ(stamp.nanosec(), 999'999'999U);
  EXPECT_EQ(from_message(stamp), -1);
}

TEST(Stamps, outside_the_seconds_of_ros_are_clamped) {
  const auto late = to_message(std::numeric_limits<Nanoseconds>::max());
  EXPECT_EQ(late.sec(), 2'147'483'647);
  EXPECT_EQ(late.nanosec(), 999'999'999U);
  const auto early = to_message(std::numeric_limits<Nanoseconds>::min());
  EXPECT_EQ(early.sec(), -2'147'483'648LL);
  EXPECT_EQ(early.nanosec(), 0U);
}

TEST(ImuMessage, without_attitude_says_so_by_minus_one) {
  ImuSample imu = samples::imu();
  imu.q_world_base.reset();
  const auto message = to_message(imu);
  EXPECT_EQ(message.orientation_covariance()[0], -1.0);
  EXPECT_FALSE(from_message(message).q_world_base.has_value());
}

TEST(ImuMessage, with_an_all_zero_quaternion_has_no_attitude) {
  auto message = to_message(samples::imu());
  message.orientation(geometry_msgs::msg::Quaternion());
  EXPECT_FALSE(from_message(message).q_world_base.has_value());
}

TEST(ImuMessage, has_its_quaternion_in_the_order_x_y_z_w) {
  ImuSample imu = samples::imu();
  imu.q_world_base = Eigen::Quaterniond(0.1, 0.2, 0.3, 0.4);  // Eigen's order here is w x y z
  const auto message = to_message(imu);
  EXPECT_EQ(message.orientation().x(), 0.2);
  EXPECT_EQ(message.orientation().y(), 0.3);
  EXPECT_EQ(message.orientation().z(), 0.4);
  EXPECT_EQ(message.orientation().w(), 0.1);
}

TEST(FixMessage, has_its_covariance_row_by_row) {
  GnssFix fix;
  fix.covariance_enu_m2 << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  EXPECT_THAT(to_message(fix).position_covariance(), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
}

TEST(FixMessage, of_an_unknown_status_is_not_taken_for_a_fix) {
  auto message = to_message(samples::fix());
  for (const int status : {-128, -3, 3, 127}) {
    message.status().status(static_cast<std::int8_t>(status));
    EXPECT_EQ(from_message(message).status, FixStatus::kUnknown) << status;
  }
}

TEST(FixMessage, of_an_unknown_covariance_type_has_an_unknown_covariance) {
  auto message = to_message(samples::fix());
  message.position_covariance_type(4);
  EXPECT_EQ(from_message(message).covariance_type, CovarianceType::kUnknown);
}

TEST(TwistMessage, is_the_linear_part_alone) {
  geometry_msgs::msg::TwistWithCovarianceStamped message;
  message.header().stamp().sec(7);
  message.header().stamp().nanosec(9);
  message.header().frame_id("base_link");
  message.twist().twist().linear().x(-1.0);
  message.twist().twist().linear().y(2.0);
  message.twist().twist().linear().z(3.0);
  message.twist().twist().angular().z(4.0);
  for (std::size_t i = 0; i < 36; ++i) {
    message.twist().covariance()[i] = static_cast<double>(i);
  }
  const TwistMeasurement twist = twist_from_message(message);
  EXPECT_EQ(twist.stamp_ns, 7'000'000'009);
  EXPECT_EQ(twist.frame_id, "base_link");
  EXPECT_EQ(twist.linear_mps, Eigen::Vector3d(-1.0, 2.0, 3.0));
  Eigen::Matrix3d expected;  // six to a row, of which the first three
  expected << 0, 1, 2, 6, 7, 8, 12, 13, 14;
  EXPECT_EQ(twist.covariance_m2ps2, expected);
}

TEST(TwistMessage, of_an_odometry_is_in_its_child_frame) {
  const Odometry odometry = samples::odometry();
  const TwistMeasurement twist = twist_from_message(to_message(odometry));
  EXPECT_EQ(twist.stamp_ns, odometry.stamp_ns);
  EXPECT_EQ(twist.frame_id, odometry.child_frame_id);
  EXPECT_EQ(twist.linear_mps, odometry.linear_mps);
  EXPECT_EQ(twist.covariance_m2ps2, (odometry.twist_covariance.topLeftCorner<3, 3>()));
}

TEST(TwistMessage, as_an_odometry_comes_back_and_claims_no_pose) {
  const auto message = to_odometry_message(samples::twist());
  samples::expect_equal(twist_from_message(message), samples::twist());
  EXPECT_EQ(message.pose().covariance()[0], kUnknownVariance);
  EXPECT_EQ(message.pose().covariance()[35], kUnknownVariance);
  EXPECT_EQ(message.twist().covariance()[35], kUnknownVariance);
}

TEST(TwistMessage, is_not_judged) {
  auto message = to_message(samples::twist());
  message.twist().twist().linear().x(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(twist_from_message(message).linear_mps.x()));
}

TEST(YawMessage, is_an_imu_whose_orientation_comes_as_it_is) {
  auto message = to_message(samples::imu());
  message.orientation().w(0.9);  // not of unit length any more
  message.orientation_covariance({1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 0.04});
  const YawMeasurement yaw = yaw_from_message(message);
  EXPECT_EQ(yaw.stamp_ns, samples::imu().stamp_ns);
  EXPECT_EQ(yaw.frame_id, samples::imu().frame_id);
  ASSERT_TRUE(yaw.q_world_base);
  EXPECT_EQ(yaw.q_world_base->coeffs(), Eigen::Vector4d(-0.5, 0.5, -0.5, 0.9));
  EXPECT_EQ(yaw.variance_rad2, 0.04);
}

TEST(YawMessage, without_an_orientation_has_none) {
  auto without = to_message(samples::yaw());
  without.orientation_covariance()[0] = -1.0;
  EXPECT_FALSE(yaw_from_message(without).q_world_base);
  auto zero = to_message(samples::yaw());
  zero.orientation(geometry_msgs::msg::Quaternion());
  zero.orientation().w(0.0);
  EXPECT_FALSE(yaw_from_message(zero).q_world_base);
  YawMeasurement none = samples::yaw();
  none.q_world_base.reset();
  EXPECT_FALSE(yaw_from_message(to_message(none)).q_world_base);
}

TEST(YawMessage, says_that_it_measures_neither_rate_nor_acceleration) {
  const auto message = to_message(samples::yaw());
  EXPECT_EQ(message.angular_velocity_covariance()[0], -1.0);
  EXPECT_EQ(message.linear_acceleration_covariance()[0], -1.0);
}

TEST(OdometryMessage, has_position_before_rotation_row_by_row) {
  const auto message = to_message(samples::odometry());
  EXPECT_EQ(message.pose().covariance()[1], 101.0);   // x with y
  EXPECT_EQ(message.pose().covariance()[6], 106.0);   // y with x
  EXPECT_EQ(message.pose().covariance()[35], 135.0);  // yaw
}

TEST(DatumMessage, is_a_fix_with_the_time_of_its_election) {
  const auto message = to_message(samples::datum());
  EXPECT_EQ(from_message(message.header().stamp()), samples::datum().elected_ns);
  EXPECT_EQ(message.altitude(), 345.6);
  EXPECT_EQ(message.status().status(), 0);
}

TEST(CloudMessage, is_moved_without_losing_a_field) {
  samples::expect_equal(from_message(to_message(samples::cloud())), samples::cloud());
}

TEST(StateUpdateMessage, without_an_alignment_has_none_after_the_way_back) {
  StateUpdate update = samples::state_update();
  update.first_alignment.reset();
  EXPECT_FALSE(from_message(to_message(update)).first_alignment.has_value());
}

TEST(Enumerators, that_are_not_known_become_the_most_cautious) {
  auto gps = to_message(samples::gps_status());
  gps.health(200);
  gps.gnss_class(6);
  EXPECT_EQ(from_message(gps).health, GpsHealth::kFault);
  EXPECT_EQ(from_message(gps).gnss_class, GnssClass::kUnknown);

  auto lio = to_message(samples::lio_status());
  lio.health(5);
  EXPECT_EQ(from_message(lio).health, LioHealth::kLost);

  auto update = to_message(samples::state_update());
  update.decision({3, 255, 1});
  update.mode(2);
  EXPECT_THAT(from_message(update).decision,
              ElementsAre(AxisDecision::kLio, AxisDecision::kLio, AxisDecision::kFused));
  EXPECT_EQ(from_message(update).mode, UpdateMode::kRows);
}

TEST(TfMessage, carries_every_transform) {
  const StampedTransform first{5, "map", "odom", {{0.5, 0.5, -0.5, 0.5}, {1.0, 2.0, 3.0}}};
  const StampedTransform second{6, "odom", "base_link", {{1.0, 0.0, 0.0, 0.0}, {4.0, 5.0, 6.0}}};
  const auto back = from_message(to_tf_message(std::vector{first, second}));
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].stamp_ns, 5);
  EXPECT_EQ(back[0].frame_id, "map");
  EXPECT_EQ(back[0].child_frame_id, "odom");
  EXPECT_EQ(back[0].T_frame_child.p, first.T_frame_child.p);
  EXPECT_EQ(back[0].T_frame_child.q.coeffs(), first.T_frame_child.q.coeffs());
  EXPECT_EQ(back[1].child_frame_id, "base_link");
  EXPECT_EQ(back[1].T_frame_child.p, second.T_frame_child.p);
}

TEST(DiagnosticMessage, carries_level_text_and_numbers) {
  const Diagnostic lost{DiagnosticLevel::kError,
                        "lio_mapper: registration",
                        "lost",
                        "lidar 7",
                        {{"inliers", "12"}, {"expected", "500"}}};
  const auto message = to_message(Nanoseconds{77}, std::vector{lost, Diagnostic{}});
  EXPECT_EQ(from_message(message.header().stamp()), 77);
  const auto back = from_message(message);
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].level, DiagnosticLevel::kError);
  EXPECT_EQ(back[0].name, lost.name);
  EXPECT_EQ(back[0].message, lost.message);
  EXPECT_EQ(back[0].hardware_id, lost.hardware_id);
  EXPECT_EQ(back[0].values, lost.values);
}

}  // namespace
}  // namespace trigpoint::bus
