// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Who is wrong when fixes contradict eskf18.
#include "driven.hpp"
#include "eskf18_drives.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <optional>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kDegree_m = 111'200.0;

/// Straight on and round a wide bend, without a stop.
Profile steadily(double speed_mps) {
  Profile profile = town(speed_mps, 3.0);
  profile.speed_mps = [=](double t) { return speed_mps * std::clamp((t - 3.0) / 2.0, 0.0, 1.0); };
  return profile;
}

/// Calls `change` with the time of each fix; false drops it.
std::vector<Input> with_fixes(std::vector<Input> inputs,
                              const std::function<bool(double, GnssFix&)>& change) {
  std::erase_if(inputs, [&](Input& input) {
    return input.is_fix && !change(to_seconds(input.fix.stamp_ns - kEpoch_ns), input.fix);
  });
  return inputs;
}

/// Of the samples within a time.
struct Horizontal {
  double error_m{0.0};  ///< the largest
  double sigmas{0.0};   ///< the largest error over its sigma
  double sigma_m{1e9};  ///< the smallest
};

Horizontal horizontal(const Recorded& result, double from_s, double to_s) {
  Horizontal found;
  EXPECT_TRUE(std::any_of(result.samples.begin(), result.samples.end(), [&](const Sample& s) {
    return s.time_s > from_s && s.time_s < to_s;
  }));
  for (const Sample& sample : result.samples) {
    if (sample.time_s > from_s && sample.time_s < to_s) {
      const double error_m = sample.error_m.head<2>().norm();
      const double sigma_m = sample.sigma_m.head<2>().norm();
      found.error_m = std::max(found.error_m, error_m);
      found.sigmas = std::max(found.sigmas, error_m / sigma_m);
      found.sigma_m = std::min(found.sigma_m, sigma_m);
    }
  }
  return found;
}

/// Once a step of 27 m after an outage of 150 s, within the filter's own sigma of 48 m, was held
/// against the fixes for half a minute.
TEST(InsDoubts, do_not_hold_a_step_after_an_outage_that_the_filters_own_sigma_explains) {
  Config config = config_with_datum("eskf18");
  config.eskf18.no_side_slip = false;  // dead reckoning by the IMU alone
  int far = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const auto truth = drive(errands(1.5, 3.0), 160.0);
    const auto inputs =
        with_fixes(sense(truth, cheap_robot(seed), seed),
                   [](double time_s, GnssFix&) { return time_s < 80.0 || time_s > 140.0; });
    GpsOdometry filter(config, cheap_robot(seed).robot);
    const Recorded result = run(filter, inputs, truth);
    const Horizontal drifted = horizontal(result, 139.0, 140.0);
    ASSERT_LT(drifted.sigmas, 3.0) << "the sigma explains it";
    far += drifted.error_m > 15.0 ? 1 : 0;
    const Horizontal back = horizontal(result, 142.0, 160.0);
    std::printf("%.1f m off after an outage (%.1f sigma), %.2f m and a sigma of %.2f m after it\n",
                drifted.error_m,
                drifted.sigmas,
                back.error_m,
                back.sigma_m);
    EXPECT_LT(back.error_m, 0.3);
    EXPECT_LT(horizontal(result, 142.0, 143.0).sigma_m, 2.0);
  }
  EXPECT_GE(far, 2) << "the drift is large enough to be remembered";
}

/// A position that is stuck, with fresh stamps and some millimetres of noise, while the robot goes
/// on. Once every third such fix was absorbed, and the filter's speed went with them.
TEST(InsDoubts, go_on_by_dead_reckoning_where_fixes_are_stuck_and_say_so) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const auto truth = drive(steadily(1.5), 110.0);
    std::mt19937 random(seed);
    std::normal_distribution<double> noise_m(0.0, 0.003);
    GnssFix stuck;
    const auto inputs =
        with_fixes(sense(truth, cheap_robot(seed), seed), [&](double time_s, GnssFix& fix) {
          if (time_s > 60.0 && time_s < 72.0) {
            stuck = stuck.stamp_ns == 0 ? fix : stuck;
            fix.latitude_deg = stuck.latitude_deg + noise_m(random) / kDegree_m;
            fix.longitude_deg = stuck.longitude_deg + noise_m(random) / kDegree_m;
          }
          return true;
        });
    GpsOdometry filter(config_with_datum("eskf18"), cheap_robot(seed).robot);
    const Recorded result = run(filter, inputs, truth);
    const Horizontal lying = horizontal(result, 60.0, 72.0);
    std::printf("stuck for 12 s: %.2f m off, %.1f sigma; %.2f m off later\n",
                lying.error_m,
                lying.sigmas,
                horizontal(result, 82.0, 110.0).error_m);
    EXPECT_LT(lying.error_m, 4.0);  // of 18 m
    EXPECT_LT(lying.sigmas, 3.5);
    EXPECT_LT(horizontal(result, 82.0, 110.0).error_m, 0.2);
  }
}

/// A receiver that claims 2 cm and whose last digit is a metre. Once it was taken for one that
/// jumps again and again, and the filter went its own way, by tens of metres.
TEST(InsDoubts, are_none_of_fixes_that_lie_on_a_grid_of_a_metre) {
  constexpr double kGrid_deg = 1e-5;
  const auto truth = drive(circle(2.0, 0.133, 2.5), 110.0);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto inputs = with_fixes(sense(truth, Sensors{}, seed), [](double, GnssFix& fix) {
      fix.latitude_deg = std::round(fix.latitude_deg / kGrid_deg) * kGrid_deg;
      fix.longitude_deg = std::round(fix.longitude_deg / kGrid_deg) * kGrid_deg;
      return true;
    });
    GpsOdometry filter(config_with_datum("eskf18"), RobotConfig{});
    const Horizontal found = horizontal(run(filter, inputs, truth), 20.0, 110.0);
    std::printf("fixes on a grid of a metre: worst error %.2f m\n", found.error_m);
    EXPECT_LT(found.error_m, 2.0) << "seed " << seed;
  }
}

/// What became of the fix at a time; it must have been told of.
bool was_accepted(const Recorded& result, double time_s) {
  std::optional<bool> accepted;
  for (const GpsStatus& status : result.statuses) {
    for (const FixRecord& record : status.recent_fixes) {
      if (std::abs(to_seconds(record.stamp_ns - kEpoch_ns) - time_s) < 1e-3) {
        accepted = record.accepted;
      }
    }
  }
  EXPECT_TRUE(accepted.has_value()) << time_s;
  return accepted.value_or(false);
}

void move_north(GnssFix& fix, double off_m) {
  fix.latitude_deg += off_m / kDegree_m;
}

/// By 40 m more every second, there and back.
double jumping_m(double time_s) {
  return 40.0 * (1.0 + std::fmod(std::floor(time_s), 2.0));
}

/// A receiver whose position is useless need not be wrong about the height: a step of it is the
/// receiver's, as ever, and not the end of an outage.
TEST(InsDoubts, judge_heights_as_ever_while_the_position_of_the_fixes_is_not_used) {
  const auto truth = drive(steadily(1.5), 110.0);
  const auto inputs = with_fixes(sense(truth, cheap_robot(1), 1), [](double time_s, GnssFix& fix) {
    if (time_s > 60.0 && time_s < 100.0) {
      move_north(fix, jumping_m(time_s));
      fix.altitude_m += time_s > 75.0 && time_s < 85.0 ? 3.0 : 0.0;
    }
    return true;
  });
  GpsOdometry filter(config_with_datum("eskf18"), cheap_robot(1).robot);
  const Recorded result = run(filter, inputs, truth);
  double worst_m = 0.0;
  double most_sigma_m = 0.0;
  double least_sigma_m = 1.0;
  for (const Sample& sample : result.samples) {
    if (sample.time_s > 65.0 && sample.time_s < 100.0) {
      worst_m = std::max(worst_m, std::abs(sample.error_m.z()));
      most_sigma_m = std::max(most_sigma_m, sample.sigma_m.z());
      least_sigma_m = std::min(least_sigma_m, sample.sigma_m.z());
    }
  }
  std::printf("a height of 3 m more for 10 s: %.2f m off, sigma %.3f to %.3f m\n",
              worst_m,
              least_sigma_m,
              most_sigma_m);
  EXPECT_LT(worst_m, 0.3);
}

/// The strapdown's sigma after some seconds of silence allows for most steps.
TEST(InsDoubts, do_not_end_because_the_receiver_was_silent) {
  const auto truth = drive(steadily(1.5), 90.0);
  const auto inputs = with_fixes(sense(truth, cheap_robot(1), 1), [](double time_s, GnssFix& fix) {
    if (time_s > 60.0 && time_s < 66.0) {
      move_north(fix, jumping_m(time_s));
    } else if (time_s > 60.0) {
      move_north(fix, 79.0);
    }
    return time_s < 66.0 || time_s > 72.0;
  });
  GpsOdometry filter(config_with_datum("eskf18"), cheap_robot(1).robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_FALSE(was_accepted(result, 65.8));
  EXPECT_FALSE(was_accepted(result, 72.2));
  EXPECT_FALSE(was_accepted(result, 76.0));
  EXPECT_TRUE(was_accepted(result, 79.0)) << "it holds still";
  EXPECT_LT(horizontal(result, 79.0, 90.0).error_m, 5.0);
}

/// Three fixes of one kind of solution say nothing about the first one of another kind.
TEST(InsDoubts, begin_anew_with_another_kind_of_solution) {
  const auto truth = drive(steadily(1.5), 80.0);
  const auto inputs = with_fixes(sense(truth, cheap_robot(1), 1), [](double time_s, GnssFix& fix) {
    move_north(fix, time_s < 59.9 ? 0.0 : time_s < 62.1 ? 3.0 : time_s < 62.7 ? 6.0 : 9.0);
    fix.covariance_enu_m2 *= time_s < 62.7 ? 1.0 : 9.0;
    return true;
  });
  GpsOdometry filter(config_with_datum("eskf18"), cheap_robot(1).robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_TRUE(was_accepted(result, 60.4)) << "the third one is absorbed";
  EXPECT_FALSE(was_accepted(result, 62.6)) << "it jumped again";
  EXPECT_FALSE(was_accepted(result, 62.8));
  EXPECT_FALSE(was_accepted(result, 63.0));
  EXPECT_TRUE(was_accepted(result, 63.2));
}

/// Of a receiver whose steps are coarser than it says.
TEST(InsDoubts, end_where_coarse_fixes_are_steady_within_what_they_scatter) {
  constexpr double kGrid_deg = 5e-6;
  const auto truth = drive(circle(2.0, 0.133, 2.5), 110.0);
  const auto inputs = with_fixes(sense(truth, Sensors{}, 1), [](double time_s, GnssFix& fix) {
    if (time_s > 60.0 && time_s < 70.0) {
      move_north(fix, jumping_m(time_s));
    }
    fix.latitude_deg = std::round(fix.latitude_deg / kGrid_deg) * kGrid_deg;
    fix.longitude_deg = std::round(fix.longitude_deg / kGrid_deg) * kGrid_deg;
    return true;
  });
  GpsOdometry filter(config_with_datum("eskf18"), RobotConfig{});
  const Recorded result = run(filter, inputs, truth);
  int accepted = 0;
  for (double time_s = 80.0; time_s < 90.0; time_s += 0.2) {
    accepted += was_accepted(result, time_s) ? 1 : 0;
  }
  std::printf("coarse fixes after jumps: %d of 50 accepted, %.2f m\n",
              accepted,
              horizontal(result, 80.0, 110.0).error_m);
  EXPECT_FALSE(was_accepted(result, 69.0));
  EXPECT_GE(accepted, 45);
}

/// One fix in four seconds, where a silence is longer than that.
TEST(InsDoubts, know_a_slow_receiver_that_jumps_again_and_again) {
  Config config = config_with_datum("eskf18");
  config.eskf18.suspect_outage_s = 15.0;
  Sensors sensors = cheap_robot(1);
  sensors.fix_hz = 0.25;
  const auto truth = drive(steadily(1.5), 150.0);
  const auto inputs = with_fixes(sense(truth, sensors, 1), [&](double time_s, GnssFix& fix) {
    move_north(fix, time_s < 99.0 ? 0.0 : jumping_m((time_s - 99.0) / 12.0));
    return true;
  });
  GpsOdometry filter(config, sensors.robot);
  const Recorded result = run(filter, inputs, truth);
  EXPECT_TRUE(was_accepted(result, 108.0)) << "the third one is absorbed";
  EXPECT_FALSE(was_accepted(result, 120.0)) << "it jumped again";
}

/// For two and a half minutes. Once such fixes were believed after one.
TEST(InsDoubts, last_as_long_as_the_strapdown_excludes_fixes_that_stand) {
  for (const double speed_mps : {1.5, 4.0}) {
    const auto truth = drive(town(speed_mps, 3.0), 240.0);
    std::mt19937 random(1);
    std::normal_distribution<double> noise_m(0.0, 0.003);
    GnssFix stuck;
    const auto inputs =
        with_fixes(sense(truth, cheap_robot(1), 1), [&](double time_s, GnssFix& fix) {
          if (time_s > 60.0 && time_s < 210.0) {
            stuck = stuck.stamp_ns == 0 ? fix : stuck;
            fix.latitude_deg = stuck.latitude_deg + noise_m(random) / kDegree_m;
            fix.longitude_deg = stuck.longitude_deg + noise_m(random) / kDegree_m;
          }
          return true;
        });
    GpsOdometry filter(config_with_datum("eskf18"), cheap_robot(1).robot);
    const Recorded result = run(filter, inputs, truth);
    const Horizontal lying = horizontal(result, 60.0, 210.0);
    std::printf("stuck for 150 s at %.1f m/s: %.2f m off, %.1f sigma\n",
                speed_mps,
                lying.error_m,
                lying.sigmas);
    EXPECT_LT(lying.error_m, 5.0);
    EXPECT_LT(lying.sigmas, 3.0);
    EXPECT_LT(horizontal(result, 220.0, 240.0).error_m, 0.2);
  }
}

/// The robot stands, and so do its fixes; an accelerometer that is wrong of a sudden drives off.
TEST(InsDoubts, end_after_a_minute_where_it_is_the_filter_that_is_wrong) {
  for (const double shake_mps2 : {0.0, 0.3}) {
    Profile profile = steadily(1.5);
    const auto driving_mps = profile.speed_mps;
    profile.speed_mps = [=](double t) {
      return driving_mps(t) * std::clamp((55.0 - t) / 3.0, 0.0, 1.0);
    };
    const auto truth = drive(profile, 130.0);
    auto inputs = sense(truth, cheap_robot(2), 2);
    std::mt19937 random(2);
    std::normal_distribution<double> shake(0.0, 1.0);
    for (Input& input : inputs) {
      const double time_s = to_seconds(input.imu.stamp_ns - kEpoch_ns);
      if (!input.is_fix && time_s > 55.0) {
        input.imu.accel_mps2 +=
            shake_mps2 * Eigen::Vector3d(shake(random), shake(random), shake(random));
        input.imu.accel_mps2.x() += time_s > 60.0 ? 2.0 : 0.0;
      }
    }
    GpsOdometry filter(config_with_datum("eskf18"), cheap_robot(2).robot);
    const Recorded result = run(filter, inputs, truth);
    const double off_m = horizontal(result, 118.0, 119.0).error_m;
    const double later_m = horizontal(result, 124.0, 125.0).error_m;
    std::printf(
        "wrong by 2 m/s^2, shaking by %.1f m/s^2: %.1f m off after 59 s, %.1f m after 65 s\n",
        shake_mps2,
        off_m,
        later_m);
    EXPECT_GT(off_m, 50.0) << "the filter is wrong";
    EXPECT_LT(later_m, 5.0);
  }
}

}  // namespace
}  // namespace trigpoint::gps_odometry
