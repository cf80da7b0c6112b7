// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ekf15.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kNumericalStep = 1e-6;
constexpr double kJacobianTolerance = 1e-7;  // central differences of values up to some tens
constexpr double kTau_s = 2.0;

Vector15d random_state(std::mt19937_64& random) {
  std::uniform_real_distribution<double> one(-1.0, 1.0);
  Vector15d x;
  for (int i = 0; i < 15; ++i) {
    x(i) = one(random);
  }
  x.segment<3>(kPosition) *= 100.0;
  x(kAttitude + 2) *= 3.0;  // away from the wrap at pi
  x.segment<3>(kVelocity) *= 10.0;
  x.segment<3>(kAcceleration) *= 3.0;
  return x;
}

template <int M, typename Function>
Eigen::Matrix<double, M, 15> numerical_jacobian(const Vector15d& x, const Function& function) {
  Eigen::Matrix<double, M, 15> J;
  for (int i = 0; i < 15; ++i) {
    Vector15d plus = x;
    Vector15d minus = x;
    plus(i) += kNumericalStep;
    minus(i) -= kNumericalStep;
    J.col(i) = (function(plus) - function(minus)) / (2.0 * kNumericalStep);
  }
  return J;
}

MotionNoise some_noise() {
  return {0.01, 0.1, 0.1, 1.0, 1.5, kTau_s};
}

TEST(Ekf15, has_the_jacobian_of_its_motion_model) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector15d x = random_state(random);
    const double dt = 0.001 + 0.0002 * i;
    const auto numerical =
        numerical_jacobian<15>(x, [&](const Vector15d& y) { return propagate(y, dt, kTau_s); });
    EXPECT_LT((propagation_jacobian(x, dt, kTau_s) - numerical).cwiseAbs().maxCoeff(),
              kJacobianTolerance);
  }
}

TEST(Ekf15, has_the_jacobian_of_the_accelerometer) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 200; ++i) {
    const Vector15d x = random_state(random);
    const auto numerical = numerical_jacobian<3>(x, expected_specific_force);
    EXPECT_LT((specific_force_jacobian(x) - numerical).cwiseAbs().maxCoeff(), kJacobianTolerance);
  }
}

TEST(Ekf15, has_the_jacobian_of_the_antenna) {
  std::mt19937_64 random(3);
  const Eigen::Vector3d lever(0.35, 0.15, 0.6);
  for (int i = 0; i < 200; ++i) {
    const Vector15d x = random_state(random);
    const auto numerical =
        numerical_jacobian<3>(x, [&](const Vector15d& y) { return expected_antenna(y, lever); });
    EXPECT_LT((antenna_jacobian(x, lever) - numerical).cwiseAbs().maxCoeff(), kJacobianTolerance);
  }
}

TEST(Ekf15, goes_round_a_circle_with_the_centripetal_acceleration) {
  Ekf15 filter;
  filter.x(kVelocity) = 2.0;
  filter.x(kRate + 2) = 0.5;
  filter.x(kAcceleration + 1) = 1.0;  // v w
  for (int i = 0; i < 1000; ++i) {
    predict(filter, 0.01, 0.02, some_noise());
  }
  const double angle = 0.5 * 10.0;
  const Eigen::Vector3d expected(4.0 * std::sin(angle), 4.0 * (1.0 - std::cos(angle)), 0.0);
  EXPECT_LT((filter.x.segment<3>(kPosition) - expected).norm(), 1e-3);
  EXPECT_LT(std::abs(filter.x(kVelocity + 1)), 1e-9);
  EXPECT_LT(std::abs(wrap_angle(filter.x(kAttitude + 2) - angle)), 1e-9);
}

TEST(Ekf15, grows_the_same_uncertainty_however_the_time_is_cut) {
  Ekf15 at_once;
  at_once.P *= 1e-4;
  Ekf15 in_pieces = at_once;
  predict(at_once, 5.0, 0.02, some_noise());
  for (int i = 0; i < 1000; ++i) {
    predict(in_pieces, 0.005, 0.02, some_noise());
  }
  for (int i = 0; i < 15; ++i) {
    const double ratio = std::sqrt(at_once.P(i, i) / in_pieces.P(i, i));
    EXPECT_NEAR(ratio, 1.0, 0.02) << "state " << i;
  }
}

/// A random walk of the rate with q = 1 whose end is known leaves dt^3 / 12 of the angle's variance
/// (Brownian bridge), on top of what the noise of the sample leaves.
TEST(Ekf15, leaves_between_two_gyro_samples_what_a_random_walk_of_the_rate_leaves) {
  constexpr double kDt_s = 0.01;
  constexpr double kRelative = 1e-3;  // of the gyro's remaining noise
  MotionNoise noise;
  noise.rate_radps_sqrts = 1.0;
  Ekf15 filter;
  filter.P = 1e-18 * Matrix15d::Identity();
  predict(filter, kDt_s, 0.02, noise);
  EXPECT_NEAR(filter.P(kAttitude + 2, kAttitude + 2), std::pow(kDt_s, 3) / 3.0, 1e-12);
  update_imu(filter, Eigen::Vector3d::Zero(), expected_specific_force(filter.x), 1e-4, 10.0);
  const double bridge = std::pow(kDt_s, 3) / 12.0;
  EXPECT_NEAR(filter.P(kAttitude + 2, kAttitude + 2), bridge, kRelative * bridge);
}

TEST(Ekf15, learns_roll_and_pitch_from_gravity) {
  Ekf15 filter;
  filter.P.diagonal() << 1, 1, 1, 0.04, 0.04, 1e-6, 1, 1, 1, 0.01, 0.01, 0.01, 1, 1, 1;
  Vector15d truth = Vector15d::Zero();
  truth.segment<3>(kAttitude) << 0.08, -0.06, 0.0;
  MotionNoise noise = some_noise();
  noise.attitude_rad_sqrts = 0.003;
  noise.acceleration_sigma_mps2 = 0.3;
  for (int i = 0; i < 6000; ++i) {
    predict(filter, 0.01, 0.02, noise);
    update_imu(filter, Eigen::Vector3d::Zero(), expected_specific_force(truth), 0.005, 0.2);
    update_velocity(filter, Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones());
  }
  EXPECT_NEAR(filter.x(kAttitude), 0.08, 0.005);
  EXPECT_NEAR(filter.x(kAttitude + 1), -0.06, 0.005);
}

TEST(Ekf15, keeps_its_covariance_symmetric_and_positive) {
  std::mt19937_64 random(4);
  Ekf15 filter;
  for (int i = 0; i < 2000; ++i) {
    predict(filter, 0.01, 0.02, some_noise());
    update_imu(filter,
               Eigen::Vector3d::Random(),
               Eigen::Vector3d(0.0, 0.0, kGravity_mps2) + Eigen::Vector3d::Random(),
               0.005,
               0.2);
    if (i % 20 == 0) {
      update_antenna(
          filter, Eigen::Vector3d::Random(), 1e-4 * Eigen::Matrix3d::Identity(), {0.3, 0.1, 0.6});
    }
  }
  EXPECT_EQ((filter.P - filter.P.transpose()).norm(), 0.0);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix15d>(filter.P).eigenvalues()(0), 0.0);
}

TEST(Ekf15, stays_finite_at_pitch_ninety_degrees) {
  Ekf15 filter;
  filter.x(kAttitude + 1) = M_PI / 2.0;
  filter.x(kRate + 1) = 0.1;
  for (int i = 0; i < 100; ++i) {
    predict(filter, 0.01, 0.02, some_noise());
    update_imu(filter, {0.0, 0.1, 0.0}, {-kGravity_mps2, 0.0, 0.0}, 0.005, 0.2);
  }
  EXPECT_TRUE(filter.is_finite());
  EXPECT_LT(filter.P.cwiseAbs().maxCoeff(), 1e6);
}

TEST(Ekf15, is_the_same_state_after_a_change_of_frame_and_back) {
  std::mt19937_64 random(5);
  Ekf15 filter;
  filter.x = random_state(random);
  predict(filter, 0.2, 0.02, some_noise());
  const Ekf15 before = filter;
  const Eigen::Matrix3d R = so3_exp({0.001, -0.002, 0.3}).toRotationMatrix();
  const Eigen::Vector3d t(10.0, -20.0, 3.0);
  change_frame(filter, R, t);
  EXPECT_LT((filter.x.segment<3>(kPosition) - (R * before.x.segment<3>(kPosition) + t)).norm(),
            1e-9);
  EXPECT_LT((filter.R_map_base() - R * before.R_map_base()).norm(), 1e-9);
  change_frame(filter, R.transpose(), -R.transpose() * t);
  EXPECT_LT((filter.x - before.x).norm(), 1e-9);
  EXPECT_LT((filter.P - before.P).norm(), 1e-8);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
