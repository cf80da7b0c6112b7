// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

namespace {

const Datum kImuDatum{43.9456, -78.8968, 100.0, 0};

TrueState at_rest(const Eigen::Quaterniond& q) {
  TrueState state;
  state.T_map_base.q = q;
  return state;
}

}  // namespace

TEST(IdealImu, feels_gravity_upwards_and_the_turning_earth_at_rest) {
  const EarthAtDatum earth(kImuDatum, true);
  const ImuSample sample = ideal_imu(at_rest(Eigen::Quaterniond::Identity()), earth);
  // Normal gravity (Somigliana) at 43.9456 degrees and 100 m by hand.
  EXPECT_NEAR(sample.accel_mps2.z(), 9.80492, 1e-4);
  EXPECT_NEAR(sample.accel_mps2.head<2>().norm(), 0.0, 1e-12);
  EXPECT_NEAR(sample.gyro_radps.norm(), 7.292115e-5, 1e-11);
  EXPECT_NEAR(
      sample.gyro_radps.z(), 7.292115e-5 * std::sin(43.9456 * std::numbers::pi / 180.0), 1e-11);
}

TEST(IdealImu, feels_the_nose_lifted_as_forward_acceleration) {
  const EarthAtDatum earth(kImuDatum, false);
  const double lift = 0.1;  // nose up is a negative pitch
  const Eigen::Quaterniond q(Eigen::AngleAxisd(-lift, Eigen::Vector3d::UnitY()));
  const ImuSample sample = ideal_imu(at_rest(q), earth);
  EXPECT_NEAR(sample.accel_mps2.x(), earth.gravity_mps2 * std::sin(lift), 1e-12);
}

TEST(IdealImu, feels_a_left_turn_as_acceleration_to_the_left) {
  const EarthAtDatum earth(kImuDatum, false);
  TrueState state = at_rest(Eigen::Quaterniond::Identity());
  state.v_map_mps = {3.0, 0.0, 0.0};
  state.omega_base_radps = {0.0, 0.0, 0.4};
  state.a_map_mps2 = state.omega_base_radps.cross(state.v_map_mps);
  EXPECT_NEAR(ideal_imu(state, earth).accel_mps2.y(), 1.2, 1e-12);
}

TEST(ImuModel, has_the_noise_density_and_the_biases_of_its_grade) {
  ImuConfig config;
  constexpr int kSeeds = 400;
  constexpr int kSamples = 200;  // 1 s: the white part averages to density * sqrt(1 Hz)
  const ImuGrade& grade = imu_grade("low");
  double white = 0.0;
  double bias = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    ImuModel imu(config, static_cast<std::uint64_t>(seed));
    const Eigen::Vector3d gyro_bias = imu.gyro_bias_radps();
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (int i = 0; i < kSamples; ++i) {
      mean += imu.measure(ImuSample{}).gyro_radps / kSamples;
    }
    white += (mean - gyro_bias).squaredNorm() / (3.0 * kSeeds);
    bias += gyro_bias.squaredNorm() / (3.0 * kSeeds);
  }
  const double tolerance = 5.0 * std::sqrt(2.0 / (3.0 * kSeeds));
  EXPECT_NEAR(white / std::pow(grade.gyro_noise_radps_per_sqrt_hz, 2), 1.0, tolerance);
  const double expected_bias =
      std::pow(config.gyro_turn_on_bias_radps, 2) + std::pow(grade.gyro_bias_radps, 2);
  EXPECT_NEAR(bias / expected_bias, 1.0, tolerance);
}

TEST(ImuModel, saturates_and_quantises) {
  ImuConfig config;
  config.noise_scale = 0.0;
  config.gyro_limit_radps = 2.0;
  config.accel_step_mps2 = 0.5;
  ImuModel imu(config, 1);
  ImuSample ideal;
  ideal.gyro_radps = {3.0, -3.0, 1.0};
  ideal.accel_mps2 = {9.8, 0.2, -0.3};
  const ImuSample sample = imu.measure(ideal);
  EXPECT_EQ(sample.gyro_radps, Eigen::Vector3d(2.0, -2.0, 1.0));
  EXPECT_EQ(sample.accel_mps2, Eigen::Vector3d(10.0, 0.0, -0.5));
}

TEST(ImuModel, is_ideal_without_noise) {
  ImuConfig config;
  config.noise_scale = 0.0;
  ImuModel imu(config, 1);
  ImuSample ideal;
  ideal.gyro_radps = {0.1, 0.2, 0.3};
  EXPECT_EQ(imu.measure(ideal).gyro_radps, ideal.gyro_radps);
}

}  // namespace trigpoint::simulator
