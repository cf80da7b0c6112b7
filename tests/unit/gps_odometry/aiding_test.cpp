// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Wheels and heading: what is refused, and what a drive gains from them.
#include "aiding.hpp"

#include "trigpoint/base/so3.hpp"

#include "driven.hpp"
#include "ekf15.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kPi = std::numbers::pi;

// ---- checks -------------------------------------------------------------------------------------

TwistMeasurement good_twist() {
  TwistMeasurement twist;
  twist.stamp_ns = stamp_of(1.0);
  twist.linear_mps = {1.5, 0.0, 0.0};
  twist.covariance_m2ps2 = 0.01 * Eigen::Matrix3d::Identity();
  return twist;
}

YawMeasurement good_yaw(double yaw_rad = 0.3) {
  return {stamp_of(1.0), "", from_yaw(yaw_rad), 0.01};
}

TEST(CheckTwist, passes_a_good_one_with_more_than_its_covariance) {
  const auto verdict = check_twist(good_twist(), Config{});
  ASSERT_TRUE(verdict.measurement);
  EXPECT_GT(verdict.measurement->covariance_m2ps2(0, 0), 0.01);
  EXPECT_LT(verdict.measurement->covariance_m2ps2(0, 0), 0.03);
}

TEST(CheckTwist, refuses_what_is_no_velocity_by_name) {
  const auto reason = [](auto spoil) {
    TwistMeasurement twist = good_twist();
    spoil(twist);
    const auto verdict = check_twist(twist, Config{});
    EXPECT_FALSE(verdict.measurement);
    return verdict.reason;
  };
  EXPECT_EQ(reason([](TwistMeasurement& t) { t.linear_mps.y() = kNaN; }), "twist_not_finite");
  EXPECT_EQ(reason([](TwistMeasurement& t) { t.covariance_m2ps2(0, 1) = kNaN; }),
            "twist_not_finite");
  EXPECT_EQ(reason([](TwistMeasurement& t) { t.linear_mps.x() = 300.0; }), "twist_out_of_range");
  EXPECT_EQ(reason([](TwistMeasurement& t) { t.stamp_ns = -1; }), "twist_stamp_out_of_range");
}

TEST(CheckTwist, takes_an_unknown_covariance_for_a_forward_speed_alone) {
  for (const double unknown : {0.0, -1.0}) {
    TwistMeasurement twist = good_twist();
    twist.covariance_m2ps2 = unknown * Eigen::Matrix3d::Identity();
    const auto verdict = check_twist(twist, Config{});
    ASSERT_TRUE(verdict.measurement);
    EXPECT_LT(verdict.measurement->covariance_m2ps2(0, 0), 0.1);
    EXPECT_GT(verdict.measurement->covariance_m2ps2(1, 1), 1e6);
    EXPECT_GT(verdict.measurement->covariance_m2ps2(2, 2), 1e6);
  }
}

TEST(CheckTwist, makes_any_covariance_positive) {
  TwistMeasurement twist = good_twist();
  twist.covariance_m2ps2(0, 1) = twist.covariance_m2ps2(1, 0) = 5.0;
  twist.covariance_m2ps2(2, 2) = 1.7e308;
  const auto verdict = check_twist(twist, Config{});
  ASSERT_TRUE(verdict.measurement);
  EXPECT_EQ(verdict.measurement->covariance_m2ps2.llt().info(), Eigen::Success);
}

TEST(PassesGate, does_not_hear_wheels_for_a_while_after_many_refusals) {
  AidingState aiding;
  for (int i = 0; i < 20; ++i) {
    EXPECT_FALSE(passes_gate(aiding, stamp_of(0.1 * i), 20.0, 16.0));
  }
  EXPECT_FALSE(passes_gate(aiding, stamp_of(2.0), 1.0, 16.0));
  EXPECT_TRUE(passes_gate(aiding, stamp_of(30.0), 1.0, 16.0));
}

TEST(PointVelocity, of_ekf15_has_the_jacobian_of_its_differences) {
  const Eigen::Vector3d point(-0.4, 0.1, -0.2);
  Vector15d x = Vector15d::LinSpaced(-0.7, 0.7);
  const auto H = point_velocity_jacobian(point);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 15; ++i) {
    Vector15d moved = x;
    moved(i) += kStep;
    const Eigen::Vector3d difference =
        (point_velocity(moved, point) - point_velocity(x, point)) / kStep;
    EXPECT_LT((difference - H.col(i)).norm(), 1e-6);
  }
}

// ---- drives -------------------------------------------------------------------------------------

/// A drive with a wheel sensor and a heading, each optional.
struct Aided {
  Profile profile{town(1.5, 3.0)};
  double duration_s{60.0};
  Sensors sensors{rtk_robot()};
  bool wheels{false};
  double wheel_scale{1.0};
  std::optional<double> yaw_error_rad;
  double yaw_sigma_rad{0.05};
  double latency_s{0.02};
  unsigned seed{11};

  Recorded run(const std::string& name) const {
    const auto truth = drive(profile, duration_s);
    const auto inputs = sense(truth, sensors, seed);
    GpsOdometry filter(config_with_datum(name), sensors.robot);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Recorded all;
    double next_s = 0.5;
    for (const Input& input : inputs) {
      while (next_s + latency_s < input.available_s && next_s < duration_s) {
        const Truth& now = truth.at(static_cast<std::size_t>(1000.0 * next_s));
        if (wheels) {
          TwistMeasurement twist;
          twist.stamp_ns = stamp_of(next_s);
          twist.linear_mps = {wheel_scale * now.speed_mps + 0.02 * normal(random), 0.0, 0.0};
          twist.covariance_m2ps2 = Eigen::Vector3d(4e-4, 1e-2, 1e-2).asDiagonal();
          append(all.events, filter.on_twist(twist).events);
        }
        if (yaw_error_rad) {
          const double yaw = now.yaw_rad + *yaw_error_rad + 0.01 * normal(random);
          append(all.events,
                 filter.on_yaw({stamp_of(next_s), "", from_yaw(yaw), yaw_sigma_rad * yaw_sigma_rad})
                     .events);
        }
        next_s += 0.05;
      }
      const Recorded one = gps_odometry::run(filter, {input}, truth);
      append(all.samples, one.samples);
      append(all.statuses, one.statuses);
      append(all.events, one.events);
    }
    return all;
  }

  template <typename T>
  static void append(std::vector<T>& to, const std::vector<T>& from) {
    to.insert(to.end(), from.begin(), from.end());
  }
};

double yaw_error_at_end(const Recorded& result) {
  return std::abs(result.samples.back().yaw_error_rad);
}

const Sample& sample_at(const Recorded& result, double time_s) {
  return *std::find_if(result.samples.begin(), result.samples.end(), [&](const Sample& sample) {
    return sample.time_s >= time_s;
  });
}

class Aiding : public testing::TestWithParam<const char*> {};

TEST_P(Aiding, by_a_heading_gives_one_before_the_vehicle_moves) {
  Aided aided;
  aided.profile = town(1.5, 20.0);
  aided.duration_s = 15.0;
  aided.yaw_error_rad = 0.03;
  const Recorded result = aided.run(GetParam());
  EXPECT_LT(yaw_error_at_end(result), 0.1);
  EXPECT_LT(result.samples.back().yaw_sigma_rad, 0.15);
  EXPECT_EQ(result.statuses.back().health, GpsHealth::kOk);
  // A heading that is heard often says no more than once.
  EXPECT_GT(result.samples.back().yaw_sigma_rad, 0.03);
}

TEST_P(Aiding, by_a_good_heading_does_no_harm_to_a_drive) {
  Aided aided;
  aided.yaw_error_rad = 0.03;
  const Recorded result = aided.run(GetParam());
  EXPECT_LT(rms_m(result.samples, 20.0), kRtkTolerance_m);
  EXPECT_LT(yaw_error_at_end(result), 0.1);
  EXPECT_EQ(count_of(result.statuses.back(), "yaw_contradicted"), 0U);
}

TEST_P(Aiding, by_a_heading_that_is_wrong_is_found_out_by_motion) {
  for (const double error_rad : {kPi, kPi / 2.0, -1.0}) {
    Aided aided;
    aided.yaw_error_rad = error_rad;
    const Recorded result = aided.run(GetParam());
    EXPECT_LT(yaw_error_at_end(result), 0.2) << error_rad;
    EXPECT_LT(rms_m(result.samples, 40.0), 2.0 * kRtkTolerance_m) << error_rad;
    EXPECT_GE(count_of(result.statuses.back(), "yaw_contradicted"), 1U) << error_rad;
    EXPECT_GT(count_of(result.statuses.back(), "yaw_gate"), 0U) << error_rad;
  }
}

TEST_P(Aiding, by_wheels_bounds_an_outage) {
  Aided without;
  without.duration_s = 60.0;
  without.sensors.outage_from_s = 30.0;
  without.sensors.outage_to_s = 1e9;
  Aided with = without;
  with.wheels = true;
  with.wheel_scale = 1.01;
  const Sample alone = sample_at(without.run(GetParam()), 55.0);
  const Sample aided = sample_at(with.run(GetParam()), 55.0);
  EXPECT_LT(aided.sigma_m.head<2>().norm(), 0.7 * alone.sigma_m.head<2>().norm());
  EXPECT_LT(aided.error_m.head<2>().norm(), 3.0 * aided.sigma_m.head<2>().norm());
  RecordProperty("outage_25s_cm", static_cast<int>(100.0 * aided.error_m.head<2>().norm()));
  RecordProperty("without_cm", static_cast<int>(100.0 * alone.error_m.head<2>().norm()));
}

TEST_P(Aiding, by_wheels_that_spin_is_refused_and_does_no_lasting_harm) {
  Aided aided;
  aided.wheels = true;
  aided.wheel_scale = 4.0;
  const Recorded result = aided.run(GetParam());
  EXPECT_GT(count_of(result.statuses.back(), "twist_gate"), 10U);
  EXPECT_LT(rms_m(result.samples, 30.0), 1.0);
}

TEST_P(Aiding, that_comes_late_gives_what_it_gives_in_time) {
  Aided in_time;
  in_time.wheels = true;
  in_time.yaw_error_rad = 0.02;
  in_time.duration_s = 30.0;
  Aided late = in_time;
  late.latency_s = 0.4;
  const Recorded early = in_time.run(GetParam());
  const Recorded delayed = late.run(GetParam());
  // Both ends see the same measurements but for the last 0.4 s.
  EXPECT_LT((early.samples.back().error_m - delayed.samples.back().error_m).norm(), 0.05);
  EXPECT_EQ(count_of(delayed.statuses.back(), "twist_too_old"), 0U);
}

TEST_P(Aiding, with_stamps_that_cannot_be_used_is_refused_by_name) {
  Driven driven(GetParam());
  TwistMeasurement twist = good_twist();
  YawMeasurement yaw = good_yaw();
  twist.stamp_ns = yaw.stamp_ns = stamp_of(500.0);
  driven.take(driven.filter.on_twist(twist));
  driven.take(driven.filter.on_yaw(yaw));
  twist.stamp_ns = yaw.stamp_ns = stamp_of(10.0);
  driven.take(driven.filter.on_twist(twist));
  driven.take(driven.filter.on_yaw(yaw));
  driven.advance(22.0);
  for (const char* reason :
       {"twist_future_stamp", "yaw_future_stamp", "twist_too_old", "yaw_too_old"}) {
    EXPECT_EQ(count_of(driven.status, reason), 1U) << reason;
  }
  GpsOdometry fresh(config_with_datum(GetParam()), rtk_robot().robot);
  fresh.on_twist(good_twist());
  EXPECT_EQ(count_of(fresh.status(), "twist_before_imu"), 1U);
}

TEST_P(Aiding, that_is_bad_in_any_way_leaves_the_state_as_it_was) {
  Driven driven(GetParam());
  std::mt19937_64 random(3);
  const double odd[] = {0.0, -1.0, 1e300, kNaN, std::numeric_limits<double>::infinity(), 1e-300};
  for (; driven.next < driven.inputs.size() && driven.inputs[driven.next].available_s < 30.0;) {
    driven.advance(driven.inputs[driven.next].available_s + 1e-6);
    TwistMeasurement twist = good_twist();
    twist.stamp_ns = driven.odometry.stamp_ns - static_cast<Nanoseconds>(random() % 900'000'000);
    twist.linear_mps(static_cast<int>(random() % 3)) = odd[3 + random() % 2];
    driven.take(driven.filter.on_twist(twist));
    YawMeasurement yaw = good_yaw();
    yaw.stamp_ns = twist.stamp_ns;
    yaw.q_world_base->coeffs()(static_cast<int>(random() % 4)) = odd[2 + random() % 3];
    driven.take(driven.filter.on_yaw(yaw));
  }
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

INSTANTIATE_TEST_SUITE_P(Filters, Aiding, testing::Values("ekf15", "eskf18"));

TEST(Aiding, of_the_published_filter_is_refused_by_name_and_changes_nothing) {
  Driven driven("ekf15_strict");
  Driven alone("ekf15_strict");
  TwistMeasurement twist = good_twist();
  YawMeasurement yaw = good_yaw();
  twist.stamp_ns = yaw.stamp_ns = driven.odometry.stamp_ns;
  driven.take(driven.filter.on_twist(twist));
  driven.take(driven.filter.on_yaw(yaw));
  driven.advance(22.0);
  alone.advance(22.0);
  EXPECT_EQ(count_of(driven.status, "twist_not_an_input"), 1U);
  EXPECT_EQ(count_of(driven.status, "yaw_not_an_input"), 1U);
  EXPECT_EQ(driven.odometry.T_frame_child.p, alone.odometry.T_frame_child.p);
}

TEST(Aiding, in_a_frame_that_is_not_listed_is_refused_by_name) {
  RobotConfig robot = rtk_robot().robot;
  robot.twist_frame_ids = {"base_link"};
  GpsOdometry filter(config_with_datum("ekf15"), robot);
  TwistMeasurement twist = good_twist();
  twist.frame_id = "wheel_left";
  filter.on_twist(twist);
  EXPECT_EQ(count_of(filter.status(), "twist_unknown_frame"), 1U);
  twist.frame_id = "base_link";
  filter.on_twist(twist);
  EXPECT_EQ(count_of(filter.status(), "twist_unknown_frame"), 1U);
}

TEST(Aiding, by_wheels_tells_eskf18_at_once_that_it_starts_in_reverse) {
  Aided aided;
  aided.profile = reverse_start(1.5, 3.0);
  aided.wheels = true;
  const Recorded result = aided.run("eskf18");
  EXPECT_LT(std::abs(sample_at(result, 9.0).yaw_error_rad), 0.3);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
