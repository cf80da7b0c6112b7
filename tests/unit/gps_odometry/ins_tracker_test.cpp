// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// eskf18 behind the face of GpsOdometry: accuracy, heading, contradictions, faults.
#include "ins_tracker.hpp"

#include "trigpoint/base/so3.hpp"

#include "driven.hpp"
#include "eskf18_drives.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kTrackerSettled_s = 15.0;
constexpr double kInsTolerance_m = 0.03;  // rms, 3-D
constexpr double kMetresPerDegree = 111'200.0;
const char* const kIns = "eskf18";

Recorded drive_and_track(const Profile& profile,
                         double duration_s,
                         const Sensors& sensors,
                         unsigned seed) {
  const auto truth = drive(profile, duration_s);
  GpsOdometry filter(config_with_datum(kIns), sensors.robot);
  return run(filter, sense(truth, sensors, seed), truth);
}

/// Root mean square of several runs.
class Pooled {
 public:
  void add(double rms) {
    square_sum_ += rms * rms;
    ++count_;
  }

  double rms() const { return std::sqrt(square_sum_ / count_); }

 private:
  double square_sum_{0.0};
  int count_{0};
};

// ---- accuracy -----------------------------------------------------------------------------------

TEST(InsTracker, drives_with_rtk_latency_and_lever_arm_within_three_centimetres) {
  for (const double speed : {1.5, 5.0}) {
    Pooled pooled;
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const Recorded result = drive_and_track(town(speed, 3.0), 90.0, cheap_robot(seed), seed);
      pooled.add(rms_m(result.samples, kTrackerSettled_s));
      EXPECT_EQ(result.statuses.back().health, GpsHealth::kOk);
    }
    std::printf("rtk %.1f m/s: rms %.4f m\n", speed, pooled.rms());
    EXPECT_LT(pooled.rms(), kInsTolerance_m);
  }
}

TEST(InsTracker, drives_a_circle_on_two_fixes_a_second_within_five_centimetres) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Sensors sensors = cheap_robot(seed);
    sensors.fix_hz = 2.0;
    const Recorded result = drive_and_track(circle(2.0, 0.5, 3.0), 75.0, sensors, seed);
    std::printf("circle seed %u: rms %.4f m\n", seed, rms_m(result.samples, kTrackerSettled_s));
    EXPECT_LT(rms_m(result.samples, kTrackerSettled_s), 0.05);
    double lateral_mps = 0.0;
    for (auto odometry = result.odometry.end() - 1500; odometry != result.odometry.end();
         ++odometry) {
      lateral_mps += odometry->linear_mps.y() / 1500.0;
    }
    EXPECT_NEAR(lateral_mps, 0.0, 0.05);
  }
}

TEST(InsTracker, works_with_an_imu_that_is_mounted_turned) {
  Sensors sensors = cheap_robot(1);
  sensors.robot.imu_roll_pitch_yaw_base_rad = {M_PI, 0.0, M_PI / 2.0};
  EXPECT_LT(rms_m(drive_and_track(town(1.5, 3.0), 60.0, sensors, 1).samples, kTrackerSettled_s),
            kInsTolerance_m);
}

TEST(InsTracker, publishes_monotone_stamps_and_positive_covariances) {
  const Recorded result = drive_and_track(town(1.5, 3.0), 40.0, cheap_robot(1), 1);
  Nanoseconds last_ns = 0;
  for (const Odometry& odometry : result.odometry) {
    EXPECT_GT(odometry.stamp_ns, last_ns);
    last_ns = odometry.stamp_ns;
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(odometry.pose_covariance).eigenvalues()(0),
              0.0);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(odometry.twist_covariance).eigenvalues()(0),
              0.0);
  }
  EXPECT_EQ(result.statuses.back().source, kIns);
}

// ---- heading ------------------------------------------------------------------------------------

TEST(InsTracker, finds_its_heading_when_it_starts_in_motion) {
  Pooled pooled;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Recorded result = drive_and_track(town(5.0, -10.0), 60.0, cheap_robot(seed), seed);
    pooled.add(rms_m(result.samples, 25.0));
    EXPECT_LT(std::abs(result.samples.back().yaw_error_rad), 0.05);
  }
  EXPECT_LT(pooled.rms(), kInsTolerance_m);
}

TEST(InsTracker, knows_after_a_rest_that_it_starts_in_reverse) {
  Pooled pooled;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Recorded result = drive_and_track(reverse_start(1.5, 4.0), 60.0, cheap_robot(seed), seed);
    for (const Sample& sample : result.samples) {
      if (sample.yaw_sigma_rad < 1.0) {
        EXPECT_LT(std::abs(sample.yaw_error_rad), 4.0 * sample.yaw_sigma_rad) << sample.time_s;
      }
    }
    EXPECT_EQ(result.statuses.back().reset.counter, 1U) << "right from the start";
    pooled.add(rms_m(result.samples, 25.0));
  }
  EXPECT_LT(pooled.rms(), kInsTolerance_m);
}

/// Backwards all the time, and already moving at the first sample.
Profile backwards() {
  Profile profile = town(2.0, -10.0);
  const auto forward = profile.speed_mps;
  profile.speed_mps = [=](double t) { return -forward(t); };
  return profile;
}

TEST(InsTracker, turns_its_heading_round_when_it_was_in_reverse_without_a_rest_before) {
  Pooled pooled;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Recorded result = drive_and_track(backwards(), 60.0, cheap_robot(seed), seed);
    EXPECT_LT(std::abs(result.samples.back().yaw_error_rad), 0.1);
    EXPECT_EQ(result.statuses.back().health, GpsHealth::kOk);
    pooled.add(rms_m(result.samples, 30.0));
    const double converged_rad = Config{}.heading_converged_rad;
    for (const Sample& sample : result.samples) {
      EXPECT_TRUE(std::abs(sample.yaw_error_rad) < 0.5 || sample.yaw_sigma_rad > converged_rad)
          << "wrong and not DEGRADED at " << sample.time_s;
    }
  }
  EXPECT_LT(pooled.rms(), kInsTolerance_m);
}

// ---- contradictions -----------------------------------------------------------------------------

/// Fixes from 60 s on, for a while, are off to the north.
std::vector<Input> shifted(std::vector<Input> inputs, double size_m, double from_s, double to_s) {
  for (Input& input : inputs) {
    const double time_s = to_seconds(input.fix.stamp_ns - kEpoch_ns);
    if (input.is_fix && time_s > from_s - 1e-6 && time_s < to_s) {
      input.fix.latitude_deg += size_m / kMetresPerDegree;
    }
  }
  return inputs;
}

struct Faulty {
  Recorded result;
  std::vector<GpsHealth> health;  ///< at every sample
};

Faulty run_with(const std::vector<Input>& inputs, const std::vector<Truth>& truth) {
  GpsOdometry filter(config_with_datum(kIns), cheap_robot(1).robot);
  Faulty faulty{run(filter, inputs, truth), {}};
  std::size_t next = 0;
  for (const Odometry& odometry : faulty.result.odometry) {
    while (next + 1 < faulty.result.statuses.size() &&
           faulty.result.statuses[next + 1].stamp_ns <= odometry.stamp_ns) {
      ++next;
    }
    faulty.health.push_back(faulty.result.statuses[next].health);
  }
  return faulty;
}

TEST(InsTracker, does_not_follow_a_wrong_fix_for_thirty_seconds_and_keeps_no_bias_of_it) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto truth = drive(errands(1.5, 3.0), 150.0);
    const Faulty faulty =
        run_with(shifted(sense(truth, cheap_robot(1), seed), 1.0, 60.0, 90.0), truth);
    double worst_m = 0.0;
    for (std::size_t i = 0; i < faulty.health.size(); ++i) {
      const Sample& sample = faulty.result.samples[i];
      if (sample.time_s > 60.0 && sample.time_s < 91.0) {
        worst_m = std::max(worst_m, sample.error_m.norm());
      }
      if (sample.time_s > 65.0 && sample.time_s < 90.0) {
        EXPECT_TRUE(sample.sigma_m.y() >= 0.3 || faulty.health[i] >= GpsHealth::kDegraded)
            << sample.time_s;
      }
    }
    std::printf("wrong fix of 1 m for 30 s: worst error %.3f m\n", worst_m);
    EXPECT_LT(worst_m, 1.2);
    EXPECT_LT(rms_m(faulty.result.samples, 110.0), kInsTolerance_m) << "20 s after";
    EXPECT_EQ(faulty.health.back(), GpsHealth::kOk);
  }
}

class Spike : public testing::TestWithParam<double> {};

TEST_P(Spike, moves_the_position_by_less_than_thirty_centimetres) {
  const auto truth = drive(errands(1.5, 3.0), 70.0);
  const Faulty faulty =
      run_with(shifted(sense(truth, cheap_robot(1), 1), GetParam(), 60.0, 60.1), truth);
  double step_m = 0.0;
  for (std::size_t i = 1; i < faulty.result.samples.size(); ++i) {
    const Sample& sample = faulty.result.samples[i];
    if (sample.time_s > 60.0) {
      step_m = std::max(step_m, (sample.error_m - faulty.result.samples[i - 1].error_m).norm());
    }
  }
  std::printf("spike of %.0f m: largest step %.4f m\n", GetParam(), step_m);
  EXPECT_LT(step_m, 0.3);
  EXPECT_EQ(count_of(faulty.result.statuses.back(), "gate"), 1U);
}

INSTANTIATE_TEST_SUITE_P(Sizes, Spike, testing::Values(5.0, 15.0, 50.0, 700.0));

TEST(InsTracker, never_takes_a_far_cluster_after_a_blackout_in_silence) {
  for (const double speed : {1.5, 5.0}) {
    const auto truth = drive(errands(speed, 3.0), 360.0);
    auto inputs = sense(truth, cheap_robot(1), 1);
    std::erase_if(inputs, [](const Input& input) {
      const double time_s = to_seconds(input.fix.stamp_ns - kEpoch_ns);
      return input.is_fix && time_s > 60.0 && time_s < 271.0;
    });
    const Faulty faulty = run_with(shifted(inputs, 700.0, 271.0, 295.0), truth);
    for (std::size_t i = 0; i < faulty.health.size(); ++i) {
      const Sample& sample = faulty.result.samples[i];
      // Fixes come 0.12 s late.
      if (sample.time_s < 271.5 || sample.time_s > 295.0) {
        continue;
      }
      EXPECT_GE(faulty.health[i], GpsHealth::kDegraded) << sample.time_s;
      if (sample.error_m.norm() > 100.0) {
        EXPECT_GT(sample.sigma_m.y(), 0.95 * 700.0 - 100.0) << sample.time_s;
      }
    }
    EXPECT_LT(rms_m(faulty.result.samples, 350.0), 0.3) << "back on good fixes";
  }
}

TEST(InsTracker, follows_a_jump_that_stays_and_says_so) {
  const auto truth = drive(errands(1.5, 3.0), 180.0);
  const Faulty faulty = run_with(shifted(sense(truth, cheap_robot(1), 1), 20.0, 60.0, 1e9), truth);
  const auto at = [&](double time_s) {
    return *std::find_if(faulty.result.samples.begin(),
                         faulty.result.samples.end(),
                         [&](const Sample& sample) { return sample.time_s >= time_s; });
  };
  EXPECT_LT(at(110.0).error_m.norm(), 1.0);
  EXPECT_GT(at(110.0).sigma_m.y(), 5.0);
  EXPECT_NEAR(at(130.0).error_m.y(), 20.0, 1.0);
  EXPECT_GT(at(130.0).sigma_m.y(), 5.0);
  EXPECT_EQ(count_of(faulty.result.statuses.back(), "recovered"), 1U);
  const auto announced = std::find_if(
      faulty.result.statuses.begin(), faulty.result.statuses.end(), [](const GpsStatus& status) {
        return status.reset.counter == 2;
      });
  ASSERT_NE(announced, faulty.result.statuses.end());
  EXPECT_NEAR(announced->reset.delta.p.y(), 20.0, 1.0);
}

TEST(InsTracker, corrects_a_wrong_fix_at_once_while_the_fix_is_not_proven) {
  const auto truth = drive(errands(1.5, 3.0), 80.0);
  auto inputs = sense(truth, cheap_robot(1), 1);
  for (Input& input : inputs) {
    const double time_s = to_seconds(input.fix.stamp_ns - kEpoch_ns);
    if (input.is_fix && time_s > 40.0 && time_s < 60.0) {  // float
      input.fix.latitude_deg += 0.4 / kMetresPerDegree;
      input.fix.covariance_enu_m2 = 0.09 * Eigen::Matrix3d::Identity();
    } else if (input.is_fix && time_s > 60.0 && time_s < 70.0) {  // fixed wrongly
      input.fix.latitude_deg += 1.0 / kMetresPerDegree;
    }
  }
  const Faulty faulty = run_with(inputs, truth);
  EXPECT_LT(rms_m(faulty.result.samples, 71.0), 0.1);
}

TEST(InsTracker, uses_the_horizontal_part_when_the_height_is_off) {
  Driven driven(kIns);
  driven.advance(20.35, [](GnssFix& fix) {
    fix.altitude_m += 10.0;
    return true;
  });
  EXPECT_GE(count_of(driven.status, "used_without_height"), 1U);
  EXPECT_LT(driven.error_m(), 0.2);
}

// ---- rest, wheels -------------------------------------------------------------------------------

TEST(InsTracker, stands_still_while_it_rests_without_fixes) {
  Sensors sensors = cheap_robot(2);
  sensors.outage_from_s = 37.0;  // in the stop of the first errand, 35 to 39 s
  const auto truth = drive(errands(1.5, -1.0), 39.0);
  GpsOdometry filter(config_with_datum(kIns), sensors.robot);
  const Recorded result = run(filter, sense(truth, sensors, 2), truth);
  EXPECT_LT(result.samples.back().error_m.norm(), 0.1);
  EXPECT_LT(result.odometry.back().linear_mps.norm(), 0.02);
}

/// Straight on over a floor so smooth that the IMU is as quiet at 1.5 m/s as in the stops of 4 s,
/// which the coarse fixes alone tell apart.
TEST(InsTracker, does_not_take_a_steady_drive_over_a_smooth_floor_for_a_rest) {
  const auto speed_mps = [](double time_s) {
    const double in_lap_s = std::fmod(time_s, 24.0);
    return 1.5 * std::clamp(std::min(in_lap_s - 2.0, 22.0 - in_lap_s), 0.0, 1.0);
  };
  const auto truth = drive({speed_mps, [](double) { return 0.0; }}, 100.0);
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Sensors sensors;
    sensors.accel_noise_mps2 = 0.05;
    sensors.white_sigma_m = 0.3;
    sensors.wander_sigma_m = 0.4;
    sensors.wander_tau_s = 30.0;
    sensors.reported_sigma_m = 0.6;
    sensors.status = FixStatus::kFix;
    GpsOdometry filter(config_with_datum(kIns), sensors.robot);
    const Recorded result = run(filter, sense(truth, sensors, seed), truth);
    double worst_m = 0.0;
    for (const Sample& sample : result.samples) {
      worst_m = std::max(worst_m, sample.error_m.head<2>().norm());
    }
    EXPECT_LT(worst_m, 6.0) << "seed " << seed;
  }
}

/// Straight ahead, with the nose 0.3 rad to the left of the course from 20 s on: a boat in a
/// current.
TEST(InsTracker, does_not_believe_in_rolling_wheels_when_told_so) {
  Profile profile = town(3.0, 3.0);
  profile.yaw_rate_radps = [](double t) { return t > 20.0 && t < 23.0 ? 0.1 : 0.0; };
  auto truth = drive(profile, 60.0);
  Eigen::Vector3d position = truth.front().position_map_m;
  for (Truth& now : truth) {
    // The course stays: the centripetal acceleration that the IMU is given is taken back below.
    position +=
        1e-3 * now.speed_mps *
        Eigen::Vector3d(std::cos(profile.yaw_start_rad), std::sin(profile.yaw_start_rad), 0.0);
    now.position_map_m = position;
  }
  auto inputs = sense(truth, cheap_robot(1), 1);
  for (Input& input : inputs) {
    const auto at =
        static_cast<std::size_t>(std::lround(1000.0 * to_seconds(input.imu.stamp_ns - kEpoch_ns)));
    if (!input.is_fix) {
      const Truth& now = truth.at(at);
      const double slip = now.yaw_rad - profile.yaw_start_rad;
      input.imu.accel_mps2.x() += now.forward_accel_mps2 * (std::cos(slip) - 1.0);
      input.imu.accel_mps2.y() -=
          now.speed_mps * now.yaw_rate_radps + now.forward_accel_mps2 * std::sin(slip);
    }
  }
  const auto yaw_error = [&](bool constraint) {
    Config config = config_with_datum(kIns);
    config.eskf18.no_side_slip = constraint;
    GpsOdometry filter(config, cheap_robot(1).robot);
    return std::abs(run(filter, inputs, truth).samples.back().yaw_error_rad);
  };
  EXPECT_LT(yaw_error(false), 0.1);
  EXPECT_GT(yaw_error(true), 0.2) << "with the constraint the nose is held to be on the course";
}

// ---- the IMU ------------------------------------------------------------------------------------

TEST(InsTracker, integrates_between_samples_by_the_trapezoid_rule_also_where_fixes_come_between) {
  // A rate that grows by 0.2 rad/s^2, sampled at 20 Hz: the trapezoid is exact, 0.1 t^2.
  constexpr double kExact_rad = 1e-6;
  const InsTracker tracker(config_with_datum(kIns), {0.35, 0.15, 0.6});
  InsTrack track;
  for (int i = 0; i <= 100; ++i) {
    const double time_s = 0.05 * i;
    CheckedImu imu;
    imu.stamp_ns = stamp_of(time_s);
    imu.raw_gyro_radps = {0.0, 0.0, 0.2 * time_s};
    imu.accel_mps2 = imu.mean_accel_mps2 = {0.0, 0.0, 9.80665};
    tracker.apply(track, imu);
    if (i % 4 == 1) {
      MapFix fix;
      fix.checked.stamp_ns = stamp_of(time_s + 0.037);
      tracker.apply(track, fix);
    }
  }
  EXPECT_NEAR(yaw(track.filter), 2.5, kExact_rad);
}

void drop_imu(Driven& driven, double from_s, double to_s) {
  std::erase_if(driven.inputs, [&](const Input& input) {
    return input.available_s > from_s && input.available_s < to_s;
  });
}

TEST(InsTracker, bridges_a_short_gap_of_the_imu_with_a_wider_covariance) {
  Driven driven(kIns);
  const double before = std::sqrt(driven.odometry.pose_covariance(0, 0));
  drop_imu(driven, 20.0, 20.9);
  driven.advance(20.91);
  EXPECT_GT(std::sqrt(driven.odometry.pose_covariance(0, 0)), 2.0 * before);
  EXPECT_LT(driven.error_m(),
            3.0 * std::sqrt(driven.odometry.pose_covariance.diagonal().head<3>().sum()));
  driven.advance(24.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
}

TEST(InsTracker, goes_on_after_a_gap_of_three_seconds_as_dead_reckoning) {
  Driven driven(kIns);
  drop_imu(driven, 20.0, 23.0);
  const auto no_fix = [](GnssFix&) { return false; };
  driven.advance(23.2, no_fix);
  EXPECT_GT(driven.time_s(), 23.0);
  EXPECT_EQ(driven.status.reset.counter, 1U) << "no new start";
  EXPECT_GT(std::sqrt(driven.odometry.twist_covariance(0, 0)), 1.0);
  driven.advance(24.2, no_fix);
  EXPECT_EQ(driven.status.health, GpsHealth::kDeadReckoning);
  EXPECT_LT(driven.error_m(),
            3.0 * std::sqrt(driven.odometry.pose_covariance.diagonal().head<3>().sum()));
  driven.advance(32.0);
  EXPECT_LT(driven.error_m(), 2.0 * kRtkTolerance_m);
}

TEST(InsTracker, starts_anew_after_a_gap_of_seven_seconds) {
  Driven driven(kIns);
  drop_imu(driven, 20.0, 27.0);
  driven.advance(29.0);
  EXPECT_GE(driven.status.reset.counter, 2U);
  driven.advance(50.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
}

TEST(InsTracker, levels_and_constrains_again_after_the_imu_clock_went_back) {
  Driven driven(kIns);
  for (Input& input : driven.inputs) {
    const Nanoseconds back_ns = input.available_s > 20.0 ? 3600 * kNanosecondsPerSecond : 0;
    input.imu.stamp_ns -= back_ns;
    input.fix.stamp_ns -= back_ns;
  }
  driven.advance(45.0);
  EXPECT_TRUE(has_event(driven.events, "imu_clock_reset"));
  EXPECT_EQ(driven.status.health, GpsHealth::kOk);
  const double before = std::sqrt(driven.odometry.pose_covariance(0, 0));
  driven.advance(55.0, [](GnssFix&) { return false; });
  // Without the wheels' constraint ten seconds of this IMU are worth more than three metres.
  EXPECT_LT(std::sqrt(driven.odometry.pose_covariance.diagonal().head<2>().sum()), before + 2.0);
}

TEST(InsTracker, doubts_its_state_while_the_gyro_is_at_its_limit) {
  const auto sigma_after = [](double limit_radps) {
    Config config = config_with_datum(kIns);
    config.eskf18.gyro_limit_radps = limit_radps;
    Sensors sensors = cheap_robot(1);
    sensors.outage_from_s = 24.0;
    const auto truth = drive(circle(2.0, 0.5, 3.0), 26.0);
    GpsOdometry filter(config, sensors.robot);
    return run(filter, sense(truth, sensors, 1), truth).samples.back().yaw_sigma_rad;
  };
  EXPECT_GT(sigma_after(0.3), 5.0 * sigma_after(8.7));
}

}  // namespace
}  // namespace trigpoint::gps_odometry
