// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Whether the published covariance bounds the error, over many seeds, with biases as cheap IMUs
// have.
#include "drive.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr int kRuns = 20;
constexpr double kFrom_s = 40.0;

/// Errors and sigmas at one age of an outage, all axes of all runs.
struct AtAge {
  double age_s;
  int count{0};
  int inside{0};
  double square_sum{0.0};
  double variance_sum{0.0};

  double rms_m() const { return std::sqrt(square_sum / count); }

  double sigma_m() const { return std::sqrt(variance_sum / count); }
};

void add(std::vector<AtAge>& ages, const std::vector<Sample>& samples) {
  for (AtAge& at : ages) {
    for (const Sample& sample : samples) {
      if (std::abs(sample.time_s - kFrom_s - at.age_s) > 0.0051) {
        continue;
      }
      at.count += 3;
      at.inside += static_cast<int>(
          (sample.error_m.cwiseAbs().array() < 1.96 * sample.sigma_m.array()).count());
      at.square_sum += sample.error_m.squaredNorm();
      at.variance_sum += sample.sigma_m.squaredNorm();
    }
  }
}

class Outage : public testing::TestWithParam<double> {};

TEST_P(Outage, sigma_bounds_the_error_of_dead_reckoning) {
  std::vector<AtAge> ages{{0.5}, {1.0}, {2.0}, {5.0}, {10.0}, {20.0}, {30.0}};
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    std::mt19937_64 random(1000 + seed);
    std::normal_distribution<double> normal;
    const auto bias = [&](double sigma) {
      return Eigen::Vector3d(
          sigma * normal(random), sigma * normal(random), sigma * normal(random));
    };
    Sensors sensors;
    sensors.robot.antenna_position_base_m = {0.35, 0.15, 0.6};
    sensors.gyro_bias_radps = bias(0.003);
    sensors.accel_bias_mps2 = bias(0.05);
    sensors.outage_from_s = kFrom_s;
    const auto truth = drive(town(GetParam(), 3.0), kFrom_s + 31.0);
    GpsOdometry filter(config_with_datum(), sensors.robot);
    add(ages, run(filter, sense(truth, sensors, seed), truth).samples);
  }
  int count = 0;
  int inside = 0;
  for (const AtAge& at : ages) {
    std::printf(
        "%.1f m/s, %4.1f s into the outage: rms per axis %7.3f m, sigma %7.3f m, inside 1.96 sigma "
        "%.3f\n",
        GetParam(),
        at.age_s,
        at.rms_m(),
        at.sigma_m(),
        static_cast<double>(at.inside) / at.count);
    EXPECT_GT(at.sigma_m(), at.rms_m());
    EXPECT_LT(at.sigma_m(), 6.0 * at.rms_m() + 0.15) << "so wide that it says nothing";
    count += at.count;
    inside += at.inside;
  }
  EXPECT_GE(inside, 0.95 * count);
}

INSTANTIATE_TEST_SUITE_P(Speeds, Outage, testing::Values(1.5, 5.0));

class ChangeOfHealth : public testing::TestWithParam<const char*> {};

/// Two of them come by time alone, when no fix is there to be told of.
TEST_P(ChangeOfHealth, is_told_with_the_imu_sample_that_sees_it) {
  Sensors sensors;
  sensors.outage_from_s = kFrom_s;
  const auto truth = drive(town(1.5, 3.0), kFrom_s + 32.0);
  const Config config = config_with_datum(GetParam());
  GpsOdometry filter(config, sensors.robot);
  const Recorded result = run(filter, sense(truth, sensors, 1), truth);
  const double last_fix_s = to_seconds(result.statuses.back().last_accepted_fix_ns - kEpoch_ns);
  ASSERT_NEAR(last_fix_s, kFrom_s, 0.3);
  for (const auto& [health, after_s] :
       {std::pair{GpsHealth::kDeadReckoning, config.dead_reckoning_after_s},
        std::pair{GpsHealth::kStale, config.stale_after_s}}) {
    const auto told =
        std::find_if(result.statuses.begin(), result.statuses.end(), [&](const GpsStatus& s) {
          return s.stamp_ns > stamp_of(kFrom_s) && s.health == health;
        });
    ASSERT_NE(told, result.statuses.end());
    const double late_s = to_seconds(told->stamp_ns - kEpoch_ns) - last_fix_s - after_s;
    EXPECT_GE(late_s, 0.0);
    EXPECT_LT(late_s, 1.5 / sensors.imu_hz);
  }
}

INSTANTIATE_TEST_SUITE_P(Filters, ChangeOfHealth, testing::Values("ekf15", "eskf18"));

TEST(CorrelatedErrors, of_code_positions_are_within_the_published_sigma) {
  int count = 0;
  int inside = 0;
  double square_sum = 0.0;
  double variance_sum = 0.0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    Sensors sensors;
    sensors.white_sigma_m = 0.5;
    sensors.wander_sigma_m = 1.5;
    sensors.wander_tau_s = 50.0;
    sensors.reported_sigma_m = 1.7;
    sensors.status = FixStatus::kFix;
    const auto truth = drive(town(5.0, 3.0), 90.0);
    GpsOdometry filter(config_with_datum(), sensors.robot);
    for (const Sample& sample : run(filter, sense(truth, sensors, seed), truth).samples) {
      if (sample.time_s > 50.0) {
        count += 3;
        inside += static_cast<int>(
            (sample.error_m.cwiseAbs().array() < 1.96 * sample.sigma_m.array()).count());
        square_sum += sample.error_m.squaredNorm();
        variance_sum += sample.sigma_m.squaredNorm();
      }
    }
  }
  std::printf("code positions: rms per axis %.2f m, sigma %.2f m, inside %.3f\n",
              std::sqrt(square_sum / count),
              std::sqrt(variance_sum / count),
              static_cast<double>(inside) / count);
  EXPECT_GE(inside, 0.95 * count);
  EXPECT_LT(variance_sum, 16.0 * square_sum);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
