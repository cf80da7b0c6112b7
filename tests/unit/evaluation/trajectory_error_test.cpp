// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/trajectory_error.hpp"

#include "made_trajectories.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trigpoint::evaluation {
namespace {

using test::helix;
using test::straight;
using test::transformed;

constexpr double kErrorRounding = 1e-9;
constexpr double kDegree_rad = std::numbers::pi / 180.0;

TEST(Statistics, equal_the_closed_forms) {
  const auto s = statistics_of({3.0, -4.0, 0.0, 1.0});
  EXPECT_EQ(s.count, 4U);
  EXPECT_NEAR(s.rmse, std::sqrt(26.0 / 4.0), kErrorRounding);
  EXPECT_NEAR(s.mean, 2.0, kErrorRounding);
  EXPECT_NEAR(s.median, 2.0, kErrorRounding);  // between 1 and 3
  EXPECT_NEAR(s.max, 4.0, kErrorRounding);
  EXPECT_NEAR(statistics_of({5.0, 1.0, 2.0}).median, 2.0, kErrorRounding);
}

TEST(Statistics, of_nothing_are_not_numbers) {
  EXPECT_TRUE(std::isnan(statistics_of({}).rmse));
  EXPECT_EQ(statistics_of({}).count, 0U);
}

TEST(Align, yaw_and_translation_are_found_exactly) {
  const Pose truth(from_yaw(2.5), {100.0, -30.0, 4.0});
  const auto estimate = helix(200);
  const auto pairs = associate(estimate, transformed(truth, estimate)).pairs;
  const auto found = align(pairs, AlignmentKind::kYawTranslation);
  ASSERT_TRUE(found);
  EXPECT_LT((found->p - truth.p).norm(), kErrorRounding);
  EXPECT_LT(found->q.angularDistance(truth.q), kErrorRounding);
}

TEST(Align, se3_is_found_exactly) {
  const Pose truth(from_roll_pitch_yaw({0.3, -0.2, 1.0}), {5.0, 6.0, -7.0});
  const auto estimate = helix(200);
  const auto pairs = associate(estimate, transformed(truth, estimate)).pairs;
  const auto found = align(pairs, AlignmentKind::kSe3);
  ASSERT_TRUE(found);
  EXPECT_LT((found->p - truth.p).norm(), 1e-8);
  EXPECT_LT(found->q.angularDistance(truth.q), 1e-7);
}

TEST(Align, yaw_leaves_the_tilt_as_an_error) {
  // A plane drive tilted by 1 degree about y: z is off by x * sin(1 deg), which no yaw removes.
  const auto reference = straight(101, 1.0);
  const auto estimate = transformed(
      Pose(from_roll_pitch_yaw({0.0, kDegree_rad, 0.0}), Eigen::Vector3d::Zero()), reference);
  const auto pairs = associate(estimate, reference).pairs;
  const auto found = align(pairs, AlignmentKind::kYawTranslation);
  ASSERT_TRUE(found);
  const auto error = absolute_error(place_estimates(*found, pairs));
  EXPECT_NEAR(error.axes_m[2].max, 50.0 * std::sin(kDegree_rad), 1e-6);
}

TEST(Align, does_not_scale) {
  const auto reference = helix(100);
  Trajectory estimate = reference;
  for (auto& pose : estimate) {
    pose.pose.p *= 1.1;
  }
  const auto pairs = associate(estimate, reference).pairs;
  const auto found = align(pairs, AlignmentKind::kSe3);
  ASSERT_TRUE(found);
  EXPECT_GT(absolute_error(place_estimates(*found, pairs)).position_m.rmse, 0.5);
}

TEST(Align, minimises_the_squared_distance) {
  // Numerically: every small change of the found yaw and translation makes the sum larger.
  const auto reference = helix(100);
  Trajectory estimate = transformed(Pose(from_yaw(-0.7), {3.0, 2.0, 1.0}), reference);
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    estimate[i].pose.p += 0.3 * Eigen::Vector3d(std::sin(1.7 * static_cast<double>(i)),
                                                std::cos(2.3 * static_cast<double>(i)),
                                                std::sin(0.9 * static_cast<double>(i)));
  }
  const auto pairs = associate(estimate, reference).pairs;
  const auto found = align(pairs, AlignmentKind::kYawTranslation);
  ASSERT_TRUE(found);
  const double best = absolute_error(place_estimates(*found, pairs)).position_m.rmse;
  for (const double change : {-1e-3, 1e-3}) {
    for (int parameter = 0; parameter < 4; ++parameter) {
      Eigen::Vector3d offset = Eigen::Vector3d::Zero();
      if (parameter > 0) {
        offset[parameter - 1] = change;
      }
      const Pose other(found->q * from_yaw(parameter == 0 ? change : 0.0), found->p + offset);
      EXPECT_GT(absolute_error(place_estimates(other, pairs)).position_m.rmse, best);
    }
  }
}

TEST(Align, refuses_what_does_not_determine_it) {
  const auto line = straight(50, 1.0);
  const auto on_a_line = associate(line, line).pairs;
  EXPECT_TRUE(align(on_a_line, AlignmentKind::kYawTranslation));
  EXPECT_FALSE(align(on_a_line, AlignmentKind::kSe3));
  const auto rest = straight(50, 0.0);
  EXPECT_FALSE(align(associate(rest, rest).pairs, AlignmentKind::kYawTranslation));
  EXPECT_FALSE(align({}, AlignmentKind::kYawTranslation));
  EXPECT_TRUE(align({}, AlignmentKind::kNone));
}

TEST(AbsoluteError, of_a_constant_offset_is_that_offset) {
  const auto reference = helix(50);
  const auto estimate =
      transformed(Pose(Eigen::Quaterniond::Identity(), {3.0, -4.0, 12.0}), reference);
  const auto error = absolute_error(associate(estimate, reference).pairs);
  EXPECT_NEAR(error.position_m.rmse, 13.0, kErrorRounding);
  EXPECT_NEAR(error.horizontal_m.mean, 5.0, kErrorRounding);
  EXPECT_NEAR(error.axes_m[1].max, 4.0, kErrorRounding);
  EXPECT_LT((error.bias_m - Eigen::Vector3d(3.0, -4.0, 12.0)).norm(), kErrorRounding);
  EXPECT_NEAR(error.rotation_deg.max, 0.0, 1e-6);
}

TEST(AbsoluteError, of_a_turn_is_its_angle) {
  const auto reference = straight(10, 1.0);
  Trajectory estimate = reference;
  for (auto& pose : estimate) {
    pose.pose.q = from_yaw(30.0 * kDegree_rad);
  }
  const auto error = absolute_error(associate(estimate, reference).pairs);
  EXPECT_NEAR(error.rotation_deg.median, 30.0, kErrorRounding);
  EXPECT_NEAR(error.position_m.max, 0.0, kErrorRounding);
}

TEST(RelativeError, of_an_odometer_that_shows_two_percent_more_is_two_percent) {
  const auto reference = straight(201, 1.0);
  const auto estimate = straight(201, 1.02);
  const auto error = relative_error(associate(estimate, reference).pairs, 50.0);
  EXPECT_EQ(error.segments, 151U);  // from 0..150 m
  EXPECT_NEAR(error.translation_percent, 2.0, kErrorRounding);
  EXPECT_NEAR(error.rotation_deg_per_m, 0.0, kErrorRounding);
}

TEST(RelativeError, of_a_gyro_drift_is_the_drift_per_metre) {
  const auto reference = straight(101, 1.0);
  Trajectory estimate = reference;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    estimate[i].pose.q = from_yaw(0.1 * kDegree_rad * static_cast<double>(i));
  }
  const auto error = relative_error(associate(estimate, reference).pairs, 10.0);
  EXPECT_NEAR(error.rotation_deg_per_m, 0.1, kErrorRounding);
}

TEST(RelativeError, does_not_see_where_the_estimate_begins) {
  const auto reference = helix(300);
  const auto estimate =
      transformed(Pose(from_roll_pitch_yaw({0.1, 0.2, 3.0}), {50.0, 60.0, 70.0}), reference);
  const auto error = relative_error(associate(estimate, reference).pairs, 10.0);
  EXPECT_GT(error.segments, 0U);
  EXPECT_NEAR(error.translation_percent, 0.0, 1e-8);
}

TEST(RelativeError, of_a_drive_shorter_than_the_segment_is_not_a_number) {
  const auto reference = straight(10, 1.0);
  const auto error = relative_error(associate(reference, reference).pairs, 50.0);
  EXPECT_EQ(error.segments, 0U);
  EXPECT_TRUE(std::isnan(error.translation_percent));
}

TEST(RelativePositionError, needs_no_attitude_of_the_reference) {
  auto reference = straight(101, 1.0);
  for (auto& pose : reference) {
    pose.pose.q = from_yaw(1.0);  // what a fix does not know
  }
  const auto error = relative_position_error(associate(straight(101, 1.01), reference).pairs, 10.0);
  EXPECT_NEAR(error.translation_percent, 1.0, kErrorRounding);
  EXPECT_TRUE(std::isnan(error.rotation_deg_per_m));
}

TEST(EndToEnd, tells_error_distance_and_percent) {
  const auto reference = straight(101, 1.0);
  Trajectory estimate = transformed(Pose(from_yaw(1.0), {7.0, 8.0, 9.0}), reference);
  estimate.back().pose = estimate.back().pose * Pose(from_yaw(0.5), {0.0, 2.0, 0.0});
  const auto result = end_to_end(associate(estimate, reference).pairs);
  EXPECT_NEAR(result.error_m, 2.0, kErrorRounding);
  EXPECT_NEAR(result.error_deg, 0.5 / kDegree_rad, 1e-6);
  EXPECT_NEAR(result.distance_m, 100.0, kErrorRounding);
  EXPECT_NEAR(result.percent, 2.0, kErrorRounding);
}

}  // namespace
}  // namespace trigpoint::evaluation
