// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include "trigpoint/geodesy/local_frame.hpp"

#include "drive.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kRtkTolerance_m = 0.10;
constexpr double kSettled_s = 15.0;

Sensors rtk_robot() {
  Sensors sensors;
  sensors.robot.antenna_position_base_m = {0.35, 0.15, 0.6};
  sensors.gyro_bias_radps = {0.002, -0.002, 0.003};
  sensors.accel_bias_mps2 = {0.05, -0.03, 0.05};
  return sensors;
}

Recorded drive_and_run(const Profile& profile,
                       double duration_s,
                       const Sensors& sensors,
                       unsigned seed) {
  const auto truth = drive(profile, duration_s);
  GpsOdometry filter(config_with_datum(), sensors.robot);
  return run(filter, sense(truth, sensors, seed), truth);
}

/// A filter that has driven for 20 s; what it is told then is up to the test.
struct Driven {
  Driven()
      : truth(drive(town(1.5, 3.0), 60.0)),
        inputs(sense(truth, rtk_robot(), 1)),
        filter(config_with_datum(), rtk_robot().robot) {
    advance(20.0);
  }

  /// Feeds the inputs until `time_s`; `change` may alter a fix or drop it (false).
  template <typename Change>
  void advance(double time_s, const Change& change) {
    for (; next < inputs.size() && inputs[next].available_s < time_s; ++next) {
      Input input = inputs[next];
      if (input.is_fix && !change(input.fix)) {
        continue;
      }
      take(input.is_fix ? filter.on_fix(input.fix) : filter.on_imu(input.imu));
    }
  }

  void advance(double time_s) {
    advance(time_s, [](GnssFix&) { return true; });
  }

  void take(const Output& output) {
    if (output.status) {
      status = *output.status;
    }
    if (output.odometry) {
      EXPECT_TRUE(output.odometry->T_frame_child.is_finite());
      EXPECT_TRUE(output.odometry->pose_covariance.allFinite());
      odometry = *output.odometry;
    }
    events.insert(events.end(), output.events.begin(), output.events.end());
  }

  double time_s() const { return to_seconds(odometry.stamp_ns - kEpoch_ns); }

  double error_m() const {
    const auto index = static_cast<std::size_t>(std::lround(time_s() * 1000.0));
    return (odometry.T_frame_child.p - truth.at(index).position_map_m).norm();
  }

  std::vector<Truth> truth;
  std::vector<Input> inputs;
  GpsOdometry filter;
  std::size_t next{0};
  GpsStatus status;
  Odometry odometry;
  Events events;
};

bool has_event(const Events& events, const std::string& code) {
  return std::any_of(
      events.begin(), events.end(), [&](const Event& event) { return event.code == code; });
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

// ---- bad fixes ----------------------------------------------------------------------------------

struct BadFix {
  const char* reason;
  void (*spoil)(GnssFix&);
};

class BadFixes : public testing::TestWithParam<BadFix> {};

TEST_P(BadFixes, are_counted_and_leave_the_state_as_it_was) {
  Driven spoilt;
  int bad = 0;
  // Every second fix is bad for ten seconds.
  spoilt.advance(30.0, [&](GnssFix& fix) {
    if ((fix.stamp_ns / 200'000'000) % 2 == 0) {
      GetParam().spoil(fix);
      ++bad;
    }
    return true;
  });
  EXPECT_EQ(count_of(spoilt.status, GetParam().reason), static_cast<std::uint64_t>(bad));
  EXPECT_LT(spoilt.error_m(), kRtkTolerance_m);
  EXPECT_EQ(spoilt.status.reset.counter, 1U) << "the one of the first heading";
}

INSTANTIATE_TEST_SUITE_P(
    TableE,
    BadFixes,
    testing::Values(
        BadFix{"not_finite", [](GnssFix& f) { f.latitude_deg = kNaN; }},
        BadFix{"not_finite",
               [](GnssFix& f) { f.altitude_m = std::numeric_limits<double>::infinity(); }},
        BadFix{"covariance_not_finite", [](GnssFix& f) { f.covariance_enu_m2(2, 2) = kNaN; }},
        BadFix{"covariance_huge", [](GnssFix& f) { f.covariance_enu_m2(0, 0) = 1.7e308; }},
        BadFix{"used_with_default_covariance", [](GnssFix& f) { f.covariance_enu_m2.setZero(); }},
        BadFix{"used_with_default_covariance",
               [](GnssFix& f) { f.covariance_enu_m2(1, 1) = -4.0; }},
        BadFix{"used_with_diagonal_covariance",
               [](GnssFix& f) { f.covariance_enu_m2(0, 1) = f.covariance_enu_m2(1, 0) = 5.0; }},
        BadFix{"out_of_range", [](GnssFix& f) { f.latitude_deg = -2e10; }},
        BadFix{"out_of_range", [](GnssFix& f) { f.longitude_deg += 360.0; }},
        BadFix{"zero_position", [](GnssFix& f) { f.latitude_deg = f.longitude_deg = 0.0; }},
        BadFix{"no_fix", [](GnssFix& f) { f.status = FixStatus::kNoFix; }},
        BadFix{"future_stamp", [](GnssFix& f) { f.stamp_ns += 3600 * kNanosecondsPerSecond; }},
        BadFix{"too_old", [](GnssFix& f) { f.stamp_ns -= 60 * kNanosecondsPerSecond; }},
        BadFix{"gate", [](GnssFix& f) { f.latitude_deg += 3.0 / 111'200.0; }},
        BadFix{"teleport", [](GnssFix& f) { f.latitude_deg += 700.0 / 111'200.0; }}));

TEST(GpsOdometry, uses_only_the_horizontal_part_when_the_height_is_off) {
  Driven driven;
  driven.advance(22.0, [](GnssFix& fix) {
    fix.altitude_m += 10.0;
    return true;
  });
  EXPECT_GT(count_of(driven.status, "used_without_height"), 5U);
  EXPECT_LT(driven.error_m(), 1.0);
}

TEST(GpsOdometry, does_not_stay_locked_out) {
  Driven driven;
  const auto shift = [](GnssFix& fix) {
    fix.latitude_deg += 20.0 / 111'200.0;
    return true;
  };
  driven.advance(24.0, shift);
  EXPECT_LT(driven.error_m(), 2.0) << "a few seconds of contradiction are not believed";
  driven.advance(27.0, shift);
  EXPECT_NEAR(driven.error_m(), 20.0, 1.0);
  EXPECT_EQ(count_of(driven.status, "recovered"), 1U);
  EXPECT_EQ(driven.status.reset.counter, 2U);
  EXPECT_NEAR(driven.status.reset.delta.p.y(), 20.0, 2.0);
  EXPECT_GT(std::sqrt(driven.odometry.pose_covariance(1, 1)), 3.0)
      << "half of the disagreement is remembered";
}

TEST(GpsOdometry, refuses_a_receiver_that_repeats_itself_while_moving) {
  Driven driven;
  GnssFix first;
  driven.advance(23.0, [&](GnssFix& fix) {
    if (first.stamp_ns == 0) {
      first = fix;
    }
    fix.latitude_deg = first.latitude_deg;
    fix.longitude_deg = first.longitude_deg;
    fix.altitude_m = first.altitude_m;
    return true;
  });
  EXPECT_GT(count_of(driven.status, "frozen"), 8U);
}

// ---- bad IMU ------------------------------------------------------------------------------------

TEST(GpsOdometry, survives_imu_samples_that_are_not_finite) {
  Driven driven;
  for (Input& input : driven.inputs) {
    if (!input.is_fix && input.available_s > 20.0 && (input.imu.stamp_ns / 10'000'000) % 3 == 0) {
      input.imu.accel_mps2.x() = kNaN;
    }
  }
  driven.advance(30.0);
  EXPECT_GT(count_of(driven.status, "imu_not_finite"), 300U);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(GpsOdometry, bridges_a_gap_of_the_imu_with_a_wider_covariance) {
  Driven driven;
  const double before = std::sqrt(driven.odometry.pose_covariance(0, 0));
  std::erase_if(driven.inputs, [](const Input& input) {
    return input.available_s > 20.0 && input.available_s < 20.9;
  });
  driven.advance(20.91);  // before the next fix is delivered
  EXPECT_GT(std::sqrt(driven.odometry.pose_covariance(0, 0)), 2.0 * before);
  EXPECT_LT(driven.error_m(),
            3.0 * std::sqrt(driven.odometry.pose_covariance.diagonal().head<3>().sum()));
  driven.advance(30.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(GpsOdometry, is_stale_when_the_imu_falls_silent_and_comes_back_with_it) {
  Driven driven;
  std::erase_if(driven.inputs, [](const Input& input) {
    return !input.is_fix && input.available_s > 20.0 && input.available_s < 23.0;
  });
  driven.advance(22.9);
  EXPECT_EQ(driven.status.health, GpsHealth::kStale);
  EXPECT_GT(count_of(driven.status, "future_stamp"), 5U);
  driven.advance(45.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(GpsOdometry, starts_anew_when_the_imu_clock_moves) {
  Driven driven;
  for (Input& input : driven.inputs) {
    input.imu.stamp_ns += input.available_s > 20.0 ? 3600 * kNanosecondsPerSecond : 0;
    input.fix.stamp_ns += input.available_s > 20.0 ? 3600 * kNanosecondsPerSecond : 0;
  }
  const Nanoseconds before_ns = driven.odometry.stamp_ns;
  driven.advance(23.0);
  EXPECT_TRUE(has_event(driven.events, "imu_clock_reset"));
  EXPECT_GT(driven.odometry.stamp_ns, before_ns + 3600 * kNanosecondsPerSecond);
  EXPECT_EQ(driven.status.datum_id, test_datum().id());
}

TEST(GpsOdometry, is_at_fault_with_an_imu_in_g) {
  Sensors sensors = rtk_robot();
  const auto truth = drive(town(1.5, 3.0), 10.0);
  auto inputs = sense(truth, sensors, 1);
  for (Input& input : inputs) {
    input.imu.accel_mps2 /= 9.80665;
  }
  GpsOdometry filter(config_with_datum(), sensors.robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_TRUE(result.odometry.empty());
  EXPECT_EQ(result.statuses.back().health, GpsHealth::kFault);
  EXPECT_TRUE(has_event(result.events, "imu_units_g"));
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

// ---- anything -----------------------------------------------------------------------------------

TEST(GpsOdometry, lets_no_random_input_out_as_anything_but_finite_and_positive) {
  std::mt19937_64 random(7);
  const double odd[] = {
      0.0, -1.0, 1.0, 1e-300, 1e300, kNaN, std::numeric_limits<double>::infinity(), 90.0, 180.0};
  const auto chance = [&](double p) {
    return std::uniform_real_distribution<double>(0.0, 1.0)(random) < p;
  };
  const auto any = [&] { return odd[random() % std::size(odd)]; };
  for (int round = 0; round < 10; ++round) {
    Driven driven;
    Nanoseconds last_ns = driven.odometry.stamp_ns;
    for (; driven.next < driven.inputs.size() && driven.inputs[driven.next].available_s < 40.0;
         ++driven.next) {
      Input input = driven.inputs[driven.next];
      if (chance(0.2)) {
        input.imu.gyro_radps(static_cast<int>(random() % 3)) = any();
        input.imu.accel_mps2(static_cast<int>(random() % 3)) = any();
        input.fix.covariance_enu_m2(static_cast<int>(random() % 3),
                                    static_cast<int>(random() % 3)) = any();
        double* place[] = {
            &input.fix.latitude_deg, &input.fix.longitude_deg, &input.fix.altitude_m};
        *place[random() % 3] = any();
      }
      if (chance(0.02)) {
        input.imu.stamp_ns += static_cast<Nanoseconds>(random() % 2'000'000'000) - 1'000'000'000;
        input.fix.stamp_ns =
            chance(0.1) ? std::numeric_limits<Nanoseconds>::max() : input.imu.stamp_ns;
      }
      const Output output =
          input.is_fix ? driven.filter.on_fix(input.fix) : driven.filter.on_imu(input.imu);
      if (output.odometry) {
        ASSERT_TRUE(output.odometry->T_frame_child.is_finite());
        ASSERT_TRUE(output.odometry->pose_covariance.allFinite());
        ASSERT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(output.odometry->pose_covariance)
                      .eigenvalues()(0),
                  0.0);
        ASSERT_GT(output.odometry->stamp_ns, last_ns);
        last_ns = output.odometry->stamp_ns;
      }
      if (output.status) {
        ASSERT_TRUE(output.status->accepted_antenna_map_m.allFinite());
        ASSERT_TRUE(output.status->accepted_covariance_map_m2.allFinite());
      }
    }
  }
}

}  // namespace
}  // namespace trigpoint::gps_odometry
