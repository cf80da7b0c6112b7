// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/hand_over.hpp"

#include "trigpoint/base/so3.hpp"

#include "simulated_drive.hpp"
#include <gtest/gtest.h>

#include <numbers>
#include <utility>
#include <vector>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kRate_mps = 0.3;
constexpr double kRate_radps = std::numbers::pi / 180.0;
constexpr double kExact = 1e-9;

Odometry at(double at_s, const Pose& pose) {
  Odometry odometry;
  odometry.stamp_ns = from_seconds(at_s);
  odometry.T_frame_child = pose;
  odometry.pose_covariance = PoseCovariance::Identity() * 1e-4;
  return odometry;
}

TEST(HandOver, passes_an_estimate_through_that_does_not_change) {
  HandOver hand_over(kRate_mps, kRate_radps);
  for (int k = 0; k < 5; ++k) {
    const Pose pose{from_yaw(0.1 * k), {1.0 * k, 2.0, 3.0}};
    const Odometry published = hand_over.follow(at(0.1 * k, pose), pose);
    EXPECT_NEAR((published.T_frame_child.p - pose.p).norm(), 0.0, kExact);
    EXPECT_NEAR(published.T_frame_child.q.angularDistance(pose.q), 0.0, 1e-7);
    EXPECT_NEAR(published.pose_covariance(0, 0), 1e-4, kExact);
  }
}

TEST(HandOver, hands_a_change_over_at_the_rate_and_no_faster) {
  HandOver hand_over(kRate_mps, kRate_radps);
  const Pose before{from_yaw(0.0), {0.0, 0.0, 0.0}};
  const Pose after{from_yaw(0.05), {0.9, 0.0, 0.0}};
  hand_over.follow(at(0.0, before), before);
  Pose last = before;
  for (int k = 1; k <= 40; ++k) {
    const Odometry published = hand_over.follow(at(0.1 * k, after), k == 1 ? before : after);
    EXPECT_LE((published.T_frame_child.p - last.p).norm(), 0.1 * kRate_mps + kExact);
    EXPECT_LE(published.T_frame_child.q.angularDistance(last.q), 0.1 * kRate_radps + 1e-6);
    EXPECT_NEAR(published.T_frame_child.p.x(), std::min(0.9, 0.03 * k), kExact);
    EXPECT_NEAR(yaw_of(published.T_frame_child.q), std::min(0.05, 0.1 * k * kRate_radps), 1e-6);
    last = published.T_frame_child;
  }
}

TEST(HandOver, counts_what_is_left_as_uncertainty) {
  HandOver hand_over(kRate_mps, kRate_radps);
  const Pose before{from_yaw(0.0), {0.0, 0.0, 0.0}};
  const Pose after{from_yaw(0.0), {0.9, 0.0, 0.0}};
  hand_over.follow(at(0.0, before), before);
  const Odometry published = hand_over.follow(at(0.1, after), before);
  EXPECT_NEAR(published.pose_covariance(0, 0), 1e-4 + 0.87 * 0.87, kExact);
  EXPECT_NEAR(published.pose_covariance(1, 1), 1e-4, kExact);
  EXPECT_NEAR(hand_over.remaining_m().x(), -0.87, kExact);
}

TEST(HandOver, keeps_the_robots_place_when_the_estimate_turns_about_it) {
  HandOver hand_over(kRate_mps, kRate_radps);
  const Pose before{from_yaw(0.0), {100.0, 50.0, 0.0}};
  const Pose after{from_yaw(0.1), {100.0, 50.0, 0.0}};
  hand_over.follow(at(0.0, before), before);
  const Odometry published = hand_over.follow(at(0.1, after), before);
  EXPECT_NEAR((published.T_frame_child.p - before.p).norm(), 0.0, kExact);
}

TEST(HandOver, keeps_what_an_estimate_that_is_no_better_differs_by) {
  HandOver hand_over(kRate_mps, kRate_radps);
  const Pose before{from_yaw(0.0), {0.0, 0.0, 0.0}};
  const Pose after{from_yaw(0.0), {1.0, 0.0, 0.0}};
  hand_over.follow(at(0.0, before), before);
  const Odometry published = hand_over.follow(at(0.1, after), before, HandOver::Offset::kStays);
  EXPECT_NEAR(published.T_frame_child.p.x(), 0.0, kExact);
  EXPECT_NEAR(published.pose_covariance(0, 0), 1e-4 + 1.0, kExact);
}

Scenario smooth_drive(bool with_imu_rate) {
  Scenario scenario;
  scenario.config = Config{};
  scenario.config.mode = "smooth";
  scenario.with_imu_rate = with_imu_rate;
  return scenario;
}

/// Where the robot is published less where the truth is, from `from_s` on.
std::vector<std::pair<double, Eigen::Vector3d>> errors(const SimulatedDrive& drive, double from_s) {
  std::vector<std::pair<double, Eigen::Vector3d>> result;
  for (const Odometry& fused : drive.record().fused) {
    const double at_s = to_seconds(fused.stamp_ns - drive.stamp(0.0));
    if (at_s >= from_s) {
      result.emplace_back(at_s, fused.T_frame_child.p - drive.T_map_base(at_s).p);
    }
  }
  return result;
}

class LioOf : public testing::TestWithParam<bool> {};

TEST_P(LioOf, is_followed_without_delay_while_it_goes_as_the_robot_goes) {
  SimulatedDrive drive{smooth_drive(GetParam())};
  drive.run_until(30.0);
  for (const auto& [at_s, error_m] : errors(drive, 10.0)) {
    EXPECT_LT(error_m.norm(), 1e-3) << at_s;
  }
}

/// The simulated mapper takes no rows, so that what is published ends where LIO is.
TEST_P(LioOf, is_followed_at_the_rate_where_it_finds_the_robot_elsewhere) {
  constexpr double kFound_m = 0.3;
  constexpr double kAt_s = 20.0;
  SimulatedDrive drive{smooth_drive(GetParam())};
  drive.run_until(kAt_s);
  drive.lio_found_elsewhere_m.x() = kFound_m;
  drive.run_until(kAt_s + 3.0);
  const auto after = errors(drive, kAt_s - 0.5);
  for (std::size_t i = 1; i < after.size(); ++i) {
    const double dt_s = after[i].first - after[i - 1].first;
    EXPECT_LT((after[i].second - after[i - 1].second).norm(), kRate_mps * dt_s + 0.002)
        << after[i].first;
  }
  EXPECT_NEAR(after.back().second.norm(), kFound_m, 0.01);
}

// ---- the mapper falls silent in motion, and GPS carries after lio_timeout_s
// ----------------------

constexpr double kSilent_s = 20.0;

double worst(const SimulatedDrive& drive, double from_s) {
  double worst_m = 0.0;
  for (const auto& [at_s, error_m] : errors(drive, from_s)) {
    worst_m = std::max(worst_m, error_m.norm());
  }
  return worst_m;
}

/// 4 m/s, and from `from_s` on a bend of 8 m while it brakes by 2 m/s^2.
Pose braking_in_a_bend(double from_s, double now_s) {
  constexpr double kSpeed_mps = 4.0;
  constexpr double kBrakes_mps2 = 2.0;
  constexpr double kRadius_m = 8.0;
  const double braked_s = std::clamp(now_s - from_s, 0.0, kSpeed_mps / kBrakes_mps2);
  const double bend_m = kSpeed_mps * braked_s - 0.5 * kBrakes_mps2 * braked_s * braked_s;
  const double turned_rad = bend_m / kRadius_m;
  return {from_yaw(turned_rad),
          {kSpeed_mps * std::min(now_s, from_s) + kRadius_m * std::sin(turned_rad),
           kRadius_m * (1.0 - std::cos(turned_rad)),
           0.0}};
}

Scenario drive_with_headings() {
  Scenario scenario = smooth_drive(false);
  scenario.gps_yaw_sigma_rad = 0.02;
  scenario.gps_odometry_hz = 100.0;
  return scenario;
}

TEST(GateWithoutMapper, goes_as_the_gps_filter_saw_the_robot_go_meanwhile) {
  SimulatedDrive drive{drive_with_headings()};
  drive.route = [](double now_s) { return braking_in_a_bend(kSilent_s, now_s); };
  drive.run_until(kSilent_s);
  drive.lio_alive = false;
  drive.run_until(kSilent_s + 3.0);
  ASSERT_GT(errors(drive, kSilent_s + 1.0).size(), 150U);
  EXPECT_LT(worst(drive, kSilent_s - 1.0), 0.01);
}

TEST(GateWithoutMapper, follows_a_filter_that_dead_reckons_in_its_motion_only) {
  Scenario scenario = drive_with_headings();
  scenario.reception = {{10.0}, {1e9, 5.0, false, GpsHealth::kDeadReckoning}};
  SimulatedDrive drive{scenario};
  drive.gps_error_m = [](double now_s) {  // 4 m off by then, and 0.5 m/s too fast
    return Eigen::Vector3d(0.5 * std::max(0.0, now_s - 12.0), 0.0, 0.0);
  };
  drive.run_until(kSilent_s);
  drive.lio_alive = false;
  drive.run_until(kSilent_s + 2.5);
  ASSERT_GT(errors(drive, kSilent_s + 1.0).size(), 100U);
  drive.lio_alive = true;
  drive.run_until(kSilent_s + 5.0);
  EXPECT_LT(worst(drive, kSilent_s - 1.0), 0.02);
}

TEST(GateWithoutMapper, does_not_take_a_jump_of_the_filter_for_motion) {
  constexpr double kJump_m = 6.0;
  SimulatedDrive drive{drive_with_headings()};
  drive.gps_error_m = [](double now_s) {
    return Eigen::Vector3d(now_s > kSilent_s + 0.5 ? kJump_m : 0.0, 0.0, 0.0);
  };
  drive.run_until(kSilent_s);
  drive.lio_alive = false;
  drive.run_until(kSilent_s + 1.2);
  ASSERT_GT(errors(drive, kSilent_s + 1.0).size(), 10U);
  EXPECT_LT(worst(drive, kSilent_s - 1.0), 0.5);
}

INSTANTIATE_TEST_SUITE_P(Gate, LioOf, testing::Values(true, false), [](const auto& each) {
  return each.param ? "at_100_hz" : "at_10_hz";
});

}  // namespace
}  // namespace trigpoint::fusion_gate
