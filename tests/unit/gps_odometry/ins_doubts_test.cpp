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

}  // namespace
}  // namespace trigpoint::gps_odometry
