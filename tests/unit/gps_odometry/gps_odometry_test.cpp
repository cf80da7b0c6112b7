// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include "trigpoint/geodesy/local_frame.hpp"

#include "driven.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kSettled_s = 15.0;

Recorded drive_and_run(const Profile& profile,
                       double duration_s,
                       const Sensors& sensors,
                       unsigned seed) {
  const auto truth = drive(profile, duration_s);
  GpsOdometry filter(config_with_datum(), sensors.robot);
  return run(filter, sense(truth, sensors, seed), truth);
}

// ---- accuracy -----------------------------------------------------------------------------------

TEST(GpsOdometry, drives_a_circle_without_being_pulled_inwards) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Sensors sensors = rtk_robot();
    sensors.fix_hz = 2.0;
    const Recorded result = drive_and_run(circle(2.0, 0.5, 3.0), 75.0, sensors, seed);
    EXPECT_LT(rms_m(result.samples, kSettled_s), kRtkTolerance_m);
    double lateral_mps = 0.0;
    for (auto odometry = result.odometry.end() - 1500; odometry != result.odometry.end();
         ++odometry) {
      lateral_mps += odometry->linear_mps.y() / 1500.0;
    }
    EXPECT_NEAR(lateral_mps, 0.0, 0.1);
  }
}

TEST(GpsOdometry, drives_straights_and_turns_with_latency_and_lever_arm) {
  for (const double speed : {1.5, 5.0}) {
    const Recorded result = drive_and_run(town(speed, 3.0), 90.0, rtk_robot(), 1);
    EXPECT_LT(rms_m(result.samples, kSettled_s), kRtkTolerance_m) << speed << " m/s";
    EXPECT_EQ(result.statuses.back().health, GpsHealth::kOk);
  }
}

TEST(GpsOdometry, works_with_an_imu_that_is_mounted_turned) {
  Sensors sensors = rtk_robot();
  sensors.robot.imu_roll_pitch_yaw_base_rad = {M_PI, 0.0, M_PI / 2.0};
  EXPECT_LT(rms_m(drive_and_run(town(1.5, 3.0), 60.0, sensors, 1).samples, kSettled_s),
            kRtkTolerance_m);
}

TEST(GpsOdometry, finds_its_heading_when_it_starts_in_motion) {
  Sensors sensors = rtk_robot();
  const Recorded result = drive_and_run(town(5.0, -10.0), 40.0, sensors, 1);
  EXPECT_LT(rms_m(result.samples, kSettled_s), kRtkTolerance_m);
}

TEST(GpsOdometry, knows_its_heading_within_three_sigma) {
  const Recorded result = drive_and_run(town(1.5, 3.0), 60.0, rtk_robot(), 4);
  for (const Sample& sample : result.samples) {
    EXPECT_LT(std::abs(sample.yaw_error_rad), 3.0 * sample.yaw_sigma_rad) << sample.time_s;
  }
}

TEST(GpsOdometry, is_honest_about_the_position_before_the_heading_is_known) {
  const Recorded result = drive_and_run(town(1.5, 20.0), 22.0, rtk_robot(), 1);
  ASSERT_FALSE(result.samples.empty());
  EXPECT_EQ(result.statuses.back().health, GpsHealth::kDegraded);
  for (const Sample& sample : result.samples) {
    EXPECT_TRUE((sample.error_m.cwiseAbs().array() < 3.0 * sample.sigma_m.array()).all());
    EXPECT_LT(sample.sigma_m.norm(), 1.5);
  }
}

TEST(GpsOdometry, gives_the_posterior_of_the_antenna_at_the_fix) {
  const Sensors sensors = rtk_robot();
  const auto truth = drive(town(5.0, 3.0), 40.0);
  GpsOdometry filter(config_with_datum(), sensors.robot);
  const Recorded result = run(filter, sense(truth, sensors, 2), truth);
  for (const GpsStatus& status : result.statuses) {
    const double time_s = to_seconds(status.last_accepted_fix_ns - kEpoch_ns);
    if (status.last_accepted_fix_ns == 0 || time_s < kSettled_s) {
      continue;
    }
    const Truth& now = truth.at(static_cast<std::size_t>(std::lround(1000.0 * time_s)));
    const Eigen::Vector3d error =
        status.accepted_antenna_map_m - now.T_map_base() * sensors.robot.antenna_position_base_m;
    EXPECT_LT(error.norm(), kRtkTolerance_m);
    EXPECT_TRUE(
        (error.cwiseAbs2().array() < 16.0 * status.accepted_covariance_map_m2.diagonal().array())
            .all());
  }
}

// ---- what is published --------------------------------------------------------------------------

TEST(GpsOdometry, publishes_monotone_stamps_positive_covariances_and_the_contract_s_frames) {
  const Recorded result = drive_and_run(town(1.5, 3.0), 40.0, rtk_robot(), 1);
  Nanoseconds last_ns = 0;
  for (const Odometry& odometry : result.odometry) {
    EXPECT_GT(odometry.stamp_ns, last_ns);
    last_ns = odometry.stamp_ns;
    EXPECT_EQ(odometry.frame_id, "map");
    EXPECT_EQ(odometry.child_frame_id, "base_link");
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(odometry.pose_covariance).eigenvalues()(0),
              0.0);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(odometry.twist_covariance).eigenvalues()(0),
              0.0);
  }
  const double seconds =
      to_seconds(result.odometry.back().stamp_ns - result.odometry.front().stamp_ns);
  EXPECT_NEAR(static_cast<double>(result.odometry.size()) / seconds, 50.0, 2.0);
}

TEST(GpsOdometry, publishes_at_fifty_hertz_from_a_faster_imu) {
  Sensors sensors = rtk_robot();
  sensors.imu_hz = 200.0;
  const Recorded result = drive_and_run(town(1.5, 1.0), 15.0, sensors, 1);
  const double seconds =
      to_seconds(result.odometry.back().stamp_ns - result.odometry.front().stamp_ns);
  EXPECT_NEAR(static_cast<double>(result.odometry.size()) / seconds, 50.0, 2.0);
}

TEST(GpsOdometry, speaks_up_every_second_without_fixes_and_says_dead_reckoning_then_stale) {
  Driven driven;
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
  const auto drop = [](GnssFix&) { return false; };
  driven.advance(22.5, drop);
  EXPECT_EQ(driven.status.health, GpsHealth::kDeadReckoning);
  const double sigma = std::sqrt(driven.odometry.pose_covariance(0, 0));
  driven.advance(55.0, drop);
  EXPECT_EQ(driven.status.health, GpsHealth::kStale);
  EXPECT_GT(std::sqrt(driven.odometry.pose_covariance(0, 0)), sigma);
  EXPECT_NEAR(driven.time_s(), 55.0, 0.1);
}

TEST(GpsOdometry, recovers_within_two_seconds_after_an_outage) {
  Driven driven;
  driven.advance(30.0, [](GnssFix&) { return false; });
  driven.advance(32.0);
  EXPECT_LT(driven.error_m(), 0.15);
  driven.advance(35.0);
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
}

// ---- datum --------------------------------------------------------------------------------------

TEST(GpsOdometry, elects_a_datum_when_nobody_names_one) {
  const auto truth = drive(town(1.5, 3.0), 30.0);
  GpsOdometry filter(Config{}, rtk_robot().robot);
  std::optional<Datum> elected;
  Odometry last;
  for (const Input& input : sense(truth, rtk_robot(), 1)) {
    const Output output = input.is_fix ? filter.on_fix(input.fix) : filter.on_imu(input.imu);
    if (output.elected) {
      EXPECT_FALSE(elected.has_value());
      elected = output.elected;
    }
    EXPECT_TRUE(elected.has_value() || !output.odometry);
    last = output.odometry.value_or(last);
  }
  ASSERT_TRUE(elected.has_value());
  EXPECT_EQ(filter.datum()->id(), elected->id());
  const geodesy::LocalFrame elected_frame(*elected);
  const geodesy::LocalFrame frame(test_datum());
  const auto position = frame.to_map(elected_frame.to_geographic(last.T_frame_child.p));
  EXPECT_LT(
      (*position -
       truth.at(static_cast<std::size_t>(std::lround(1e3 * to_seconds(last.stamp_ns - kEpoch_ns))))
           .position_map_m)
          .norm(),
      kRtkTolerance_m);
}

TEST(GpsOdometry, adopts_an_older_datum_re_expresses_its_state_and_says_so) {
  const auto truth = drive(town(1.5, 3.0), 40.0);
  GpsOdometry filter(Config{}, rtk_robot().robot);
  Datum older = test_datum();
  older.longitude_deg += 0.05;  // 3.7 km east: north turns by 0.04 degrees
  older.elected_ns = 1;
  bool told = false;
  Odometry last;
  std::optional<Output> adoption;
  for (const Input& input : sense(truth, rtk_robot(), 1)) {
    if (!told && input.available_s > 30.0) {
      adoption = filter.on_datum(older);
      told = true;
    }
    const Output output = input.is_fix ? filter.on_fix(input.fix) : filter.on_imu(input.imu);
    last = output.odometry.value_or(last);
  }
  ASSERT_TRUE(adoption.has_value());
  EXPECT_TRUE(has_event(adoption->events, "datum_conflict"));
  EXPECT_EQ(filter.datum()->id(), older.id());
  const auto position = geodesy::LocalFrame(test_datum())
                            .to_map(geodesy::LocalFrame(older).to_geographic(last.T_frame_child.p));
  const Truth& now =
      truth.at(static_cast<std::size_t>(std::lround(1e3 * to_seconds(last.stamp_ns - kEpoch_ns))));
  EXPECT_LT((*position - now.position_map_m).norm(), kRtkTolerance_m);
}

TEST(GpsOdometry, keeps_its_datum_against_a_younger_one) {
  Driven driven;
  Datum younger = test_datum();
  younger.latitude_deg += 0.01;
  younger.elected_ns = kEpoch_ns;
  driven.take(driven.filter.on_datum(younger));
  EXPECT_TRUE(has_event(driven.events, "datum_conflict"));
  EXPECT_EQ(driven.filter.datum()->id(), test_datum().id());
}

TEST(GpsOdometry, refuses_a_datum_that_is_not_a_place) {
  Driven driven;
  driven.take(driven.filter.on_datum(Datum{}));
  EXPECT_TRUE(has_event(driven.events, "refused_datum_not_a_place"));
  EXPECT_EQ(driven.filter.datum()->id(), test_datum().id());
}

// ---- datum far away
// ------------------------------------------------------------------------------

TEST(GpsOdometry, refuses_every_fix_when_the_configured_datum_has_the_wrong_sign_and_says_so) {
  const Sensors sensors = rtk_robot();
  const auto truth = drive(town(1.5, 3.0), 20.0);
  Config config = config_with_datum();
  config.datum_longitude_deg = -config.datum_longitude_deg;
  GpsOdometry filter(config, sensors.robot);
  const Recorded result = run(filter, sense(truth, sensors, 1), truth);
  const GpsStatus& last = result.statuses.back();
  ASSERT_GT(last.fixes_received, 50U);
  EXPECT_EQ(last.fixes_accepted, 0U);
  EXPECT_GT(count_of(last, "far_from_datum"), 50U);
  EXPECT_TRUE(result.odometry.empty());
}

}  // namespace
}  // namespace trigpoint::gps_odometry
