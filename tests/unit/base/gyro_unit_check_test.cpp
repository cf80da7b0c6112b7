// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/gyro_unit_check.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace trigpoint {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kDegreesPerRad = 180.0 / kPi;
constexpr double kInterval_s = 0.01;
const Vector3d kUp{0.0, 0.0, 9.80665};

/// Ten seconds of an IMU at 100 Hz whose body turns with `rate(t)`; the gyro says `scale` times
/// that.
std::optional<std::string> verdict(const std::function<Vector3d(double)>& rate_radps,
                                   double scale = 1.0) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  GyroUnitCheck check;
  std::optional<std::string> said;
  Eigen::Quaterniond q_world_body = Eigen::Quaterniond::Identity();
  for (int i = 0; i < 1000; ++i) {
    const Vector3d rate = rate_radps(i * kInterval_s);
    q_world_body = (q_world_body * so3_exp(rate * kInterval_s)).normalized();
    said = check.add(from_seconds(i * kInterval_s),
                     scale * (rate + noise(0.005)),
                     q_world_body.conjugate() * kUp + noise(0.3));
  }
  return said;
}

Vector3d yaw_at(double rate_radps) {
  return {0.0, 0.0, rate_radps};
}

TEST(GyroUnitCheck, says_nothing_of_a_robot_at_rest_in_either_unit) {
  EXPECT_FALSE(verdict([](double) { return yaw_at(0.0); }));
  EXPECT_FALSE(verdict([](double) { return yaw_at(0.0); }, kDegreesPerRad));
}

TEST(GyroUnitCheck, says_nothing_of_a_turn_in_place) {
  EXPECT_FALSE(verdict([](double) { return yaw_at(kPi / 2.0); }));
  EXPECT_FALSE(verdict([](double) { return yaw_at(-kPi); }));
}

TEST(GyroUnitCheck, says_nothing_of_a_robot_that_rolls_over) {
  EXPECT_FALSE(
      verdict([](double t_s) { return t_s < 1.0 ? Vector3d(kPi, 0.0, 0.0) : yaw_at(0.0); }));
}

TEST(GyroUnitCheck, says_nothing_of_vibration_and_bumps) {
  EXPECT_FALSE(verdict([](double t_s) {
    return Vector3d(
        20.0 * std::sin(2.0 * kPi * 23.0 * t_s), 15.0 * std::cos(2.0 * kPi * 17.0 * t_s), 0.3);
  }));
}

TEST(GyroUnitCheck, finds_a_gyro_in_degrees_in_a_slow_turn) {
  const auto said = verdict([](double) { return yaw_at(0.2); }, kDegreesPerRad);
  ASSERT_TRUE(said);
  EXPECT_NE(said->find("is 11."), std::string::npos) << *said;
  EXPECT_NE(said->find("0.0174533"), std::string::npos) << *said;
}

TEST(GyroUnitCheck, finds_a_gyro_in_degrees_where_the_robot_tilts_by_two_degrees) {
  const auto pitching = [](double t_s) {
    return Vector3d(0.0, 0.5 * 2.0 / kDegreesPerRad * kPi * std::sin(kPi * t_s), 0.0);
  };
  const auto said = verdict(pitching, kDegreesPerRad);
  ASSERT_TRUE(said);
  EXPECT_NE(said->find("tilt"), std::string::npos) << *said;
  EXPECT_FALSE(verdict(pitching));
}

TEST(GyroUnitCheck, starts_anew_after_a_gap) {
  GyroUnitCheck check;
  for (int i = 0; i < 200; ++i) {
    // Half a second of samples at a time, a second apart.
    const double t_s = i % 50 * kInterval_s + i / 50 * 1.5;
    EXPECT_FALSE(check.add(from_seconds(t_s), yaw_at(20.0), kUp));
  }
}

}  // namespace
}  // namespace trigpoint
