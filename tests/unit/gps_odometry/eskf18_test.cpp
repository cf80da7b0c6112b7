// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "eskf18.hpp"

#include "trigpoint/base/so3.hpp"

#include "gravity.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kNumericalStep = 1e-5;
constexpr double kJacobianTolerance = 1e-7;  // central differences of values up to some hundreds
constexpr double kTau_s = 50.0;
const Vector3d kLever(0.35, 0.15, 0.6);

Vector3d random3(std::mt19937_64& random, double size) {
  std::uniform_real_distribution<double> one(-size, size);
  const double x = one(random);
  const double y = one(random);
  return {x, y, one(random)};
}

Eskf18 random_filter(std::mt19937_64& random) {
  Eskf18 filter;
  filter.p_map_m = random3(random, 100.0);
  filter.v_map_mps = random3(random, 10.0);
  filter.q_map_base = from_roll_pitch_yaw(random3(random, 1.2));
  filter.gyro_bias_radps = random3(random, 0.02);
  filter.accel_bias_mps2 = random3(random, 0.2);
  filter.fix_error_map_m = random3(random, 2.0);
  return filter;
}

ImuMean random_imu(std::mt19937_64& random) {
  return {random3(random, 1.0), random3(random, 5.0) + Vector3d(0.0, 0.0, kGravity_mps2)};
}

/// The error that leads from `from` to `to`: the inverse of with_error.
Vector18d difference(const Eskf18& to, const Eskf18& from) {
  Vector18d error;
  error << to.p_map_m - from.p_map_m, to.v_map_mps - from.v_map_mps,
      so3_log(from.q_map_base.conjugate() * to.q_map_base),
      to.gyro_bias_radps - from.gyro_bias_radps, to.accel_bias_mps2 - from.accel_bias_mps2,
      to.fix_error_map_m - from.fix_error_map_m;
  return error;
}

/// Central differences of function(filter with error), M numbers.
template <int M, typename Function>
Eigen::Matrix<double, M, 18> numerical_jacobian(const Eskf18& filter, const Function& function) {
  Eigen::Matrix<double, M, 18> J;
  for (int i = 0; i < 18; ++i) {
    const Vector18d error = kNumericalStep * Vector18d::Unit(i);
    J.col(i) = (function(with_error(filter, error)) - function(with_error(filter, -error))) /
               (2.0 * kNumericalStep);
  }
  return J;
}

InsNoise some_noise() {
  return {8e-4, 0.013, 1e-5, 2e-4, {0.02, 0.02, 0.04}, kTau_s};
}

// ---- Jacobians ----------------------------------------------------------------------------------

TEST(Eskf18, has_the_transition_of_its_strapdown) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 200; ++i) {
    const Eskf18 filter = random_filter(random);
    const ImuMean imu = random_imu(random);
    const double dt = 0.001 + 0.00025 * i;
    const Eskf18 next = propagate(filter, imu, dt, kTau_s);
    const auto numerical = numerical_jacobian<18>(filter, [&](const Eskf18& other) {
      return difference(propagate(other, imu, dt, kTau_s), next);
    });
    EXPECT_LT((transition(filter, imu, dt, kTau_s) - numerical).cwiseAbs().maxCoeff(),
              kJacobianTolerance);
  }
}

TEST(Eskf18, has_the_jacobians_of_its_measurements) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 200; ++i) {
    const Eskf18 filter = random_filter(random);
    const Vector3d gyro = random3(random, 1.0);
    const auto worst = [&](const auto& analytic, const auto& numerical) {
      return (analytic - numerical).cwiseAbs().maxCoeff();
    };
    EXPECT_LT(worst(fix_jacobian(filter, kLever),
                    numerical_jacobian<3>(
                        filter, [&](const Eskf18& other) { return expected_fix(other, kLever); })),
              kJacobianTolerance);
    EXPECT_LT(worst(antenna_jacobian(filter, kLever),
                    numerical_jacobian<3>(
                        filter, [&](const Eskf18& other) { return antenna(other, kLever); })),
              kJacobianTolerance);
    EXPECT_LT(
        worst(body_velocity_jacobian(filter, kLever),
              numerical_jacobian<3>(
                  filter, [&](const Eskf18& other) { return body_velocity(other, kLever, gyro); })),
        kJacobianTolerance);
    EXPECT_LT(worst(force_at_rest_jacobian(filter),
                    numerical_jacobian<3>(
                        filter, [](const Eskf18& other) { return force_at_rest(other); })),
              kJacobianTolerance);
    EXPECT_LT(worst(yaw_jacobian(filter),
                    numerical_jacobian<1>(filter,
                                          [](const Eskf18& other) {
                                            return Eigen::Matrix<double, 1, 1>(yaw(other));
                                          })),
              kJacobianTolerance);
  }
}

// ---- prediction ---------------------------------------------------------------------------------

TEST(Eskf18, goes_round_a_tilted_circle) {
  // Closed form: v = 2 m/s, 0.5 rad/s about the vertical, rolled by 0.1 rad, 10 s.
  const double w = 0.5;
  const double v = 2.0;
  Eskf18 filter;
  filter.q_map_base = from_roll_pitch_yaw({0.1, 0.0, 0.0});
  filter.v_map_mps = {v, 0.0, 0.0};
  const Eigen::Quaterniond q_base_level = filter.q_map_base.conjugate();
  ImuMean imu{q_base_level * Vector3d(0.0, 0.0, w),
              q_base_level * Vector3d(0.0, v * w, kGravity_mps2)};
  for (int i = 0; i < 1000; ++i) {
    predict(filter, imu, 0.01, 0.02, some_noise());
  }
  const double angle = w * 10.0;
  const Vector3d expected(v / w * std::sin(angle), v / w * (1.0 - std::cos(angle)), 0.0);
  EXPECT_LT((filter.p_map_m - expected).norm(), 1e-3);
  EXPECT_LT(std::abs(wrap_angle(yaw(filter) - angle)), 1e-9);
}

TEST(Eskf18, grows_the_same_uncertainty_however_the_time_is_cut) {
  Eskf18 at_once;
  at_once.P *= 1e-6;
  Eskf18 in_pieces = at_once;
  const ImuMean imu{{0.0, 0.0, 0.3}, {0.2, 0.6, kGravity_mps2}};
  predict(at_once, imu, 10.0, 0.05, some_noise());
  for (int i = 0; i < 4000; ++i) {
    predict(in_pieces, imu, 0.0025, 0.05, some_noise());
  }
  for (int i = 0; i < 18; ++i) {
    EXPECT_NEAR(std::sqrt(at_once.P(i, i) / in_pieces.P(i, i)), 1.0, 0.005) << "error " << i;
  }
}

TEST(Eskf18, has_errors_as_wide_as_its_covariance_says_after_dead_reckoning) {
  // Monte-Carlo against the covariance: white noise and biases as modelled, 5 s, 400 runs. The
  // mean of 400 NEES of 15 degrees of freedom lies in [14.47, 15.54] in 95 % of experiments; the
  // interval here is that of 99.9 %.
  constexpr int kRuns = 400;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  const auto normal3 = [&](double sigma) {
    const double x = sigma * normal(random);
    const double y = sigma * normal(random);
    return Vector3d(x, y, sigma * normal(random));
  };
  const InsNoise noise = some_noise();
  Vector18d sigma;
  sigma << Vector3d::Constant(0.1), Vector3d::Constant(0.1), Vector3d::Constant(0.01),
      Vector3d::Constant(0.003), Vector3d::Constant(0.05), Vector3d::Constant(0.02);
  double nees = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Eskf18 truth;
    truth.q_map_base = from_roll_pitch_yaw({0.05, -0.03, 1.0});
    Eskf18 filter = truth;
    filter.P = sigma.cwiseAbs2().asDiagonal();
    Vector18d error;
    for (int i = 0; i < 18; ++i) {
      error(i) = sigma(i) * normal(random);
    }
    filter = with_error(filter, error);
    const double dt = 0.01;
    for (int i = 0; i < 500; ++i) {
      const ImuMean ideal{{0.0, 0.0, 0.4}, Vector3d(0.5 * std::sin(0.01 * i), 0.8, kGravity_mps2)};
      ImuMean measured = ideal;
      measured.gyro_radps += normal3(noise.gyro_radps_sqrthz / std::sqrt(dt));
      measured.accel_mps2 += normal3(noise.accel_mps2_sqrthz / std::sqrt(dt));
      truth = propagate(truth, ideal, dt, kTau_s);
      predict(filter, measured, dt, 0.05, noise);
    }
    const Eigen::Matrix<double, 15, 1> e = difference(truth, filter).head<15>();
    nees += e.dot(filter.P.topLeftCorner<15, 15>().ldlt().solve(e)) / kRuns;
  }
  EXPECT_GT(nees, 14.1);
  EXPECT_LT(nees, 15.9);
}

// ---- updates ------------------------------------------------------------------------------------

TEST(Eskf18, keeps_its_covariance_symmetric_and_positive) {
  std::mt19937_64 random(4);
  Eskf18 filter;
  for (int i = 0; i < 5000; ++i) {
    predict(filter, random_imu(random), 0.01, 0.02, some_noise());
    if (i % 10 == 0) {
      update_no_side_slip(filter, 0.1, Vector3d::Zero(), random3(random, 0.1));
    }
    if (i % 20 == 0) {
      update_fix(
          filter, filter.p_map_m + random3(random, 0.02), 1e-6 * Matrix3d::Identity(), kLever);
    }
    if (i % 100 == 0) {
      update_at_rest(filter, 0.02, random3(random, 1e-3), 3e-4);
      update_yaw(filter, yaw(filter) + 0.01, 0.05);
    }
  }
  EXPECT_TRUE(filter.is_finite());
  EXPECT_EQ((filter.P - filter.P.transpose()).norm(), 0.0);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix18d>(filter.P).eigenvalues()(0), 0.0);
}

TEST(Eskf18, learns_the_gyro_s_bias_at_rest) {
  Eskf18 filter;
  Vector18d sigma;
  sigma << Vector3d::Ones(), Vector3d::Ones(), Vector3d::Constant(0.1), Vector3d::Constant(0.005),
      Vector3d::Constant(0.08), Vector3d::Ones();
  filter.P = sigma.cwiseAbs2().asDiagonal();
  const Vector3d bias(0.003, -0.002, 0.004);
  for (int i = 0; i < 20; ++i) {
    predict(filter, {bias, {0.0, 0.0, kGravity_mps2}}, 0.5, 0.02, some_noise());
    update_at_rest(filter, 0.02, bias, 3e-4);
  }
  EXPECT_LT((filter.gyro_bias_radps - bias).norm(), 3e-4);
  EXPECT_LT(filter.v_map_mps.norm(), 0.01);
}

TEST(Eskf18, finds_its_heading_through_the_lever_arm_of_a_turning_antenna) {
  // The antenna's place in map shows where the arm points: 0.38 m of arm, 5 mm fixes.
  Eskf18 filter;
  Vector18d sigma;
  sigma << Vector3d::Constant(0.01), Vector3d::Constant(0.01), 1e-3, 1e-3, 0.3,
      Vector3d::Constant(1e-5), Vector3d::Constant(1e-3), Vector3d::Constant(1e-4);
  filter.P = sigma.cwiseAbs2().asDiagonal();
  Eskf18 truth = filter;
  truth.q_map_base = from_yaw(0.25);
  for (int i = 0; i < 20; ++i) {
    update_fix(filter, antenna(truth, kLever), 25e-6 * Matrix3d::Identity(), kLever);
  }
  EXPECT_NEAR(yaw(filter), 0.25, 0.03);
}

TEST(Eskf18, takes_a_heading_and_a_velocity_of_wheels) {
  Eskf18 filter;
  update_yaw(filter, 0.4, 1e-4);
  EXPECT_NEAR(yaw(filter), 0.4, 1e-3);
  EXPECT_LT(std::sqrt((yaw_jacobian(filter) * filter.P * yaw_jacobian(filter).transpose()).value()),
            1.1e-4);
  const Vector3d wheels(1.5, 0.0, 0.0);
  update_body_velocity(filter, wheels, 1e-8 * Matrix3d::Identity(), Vector3d::Zero(), {});
  EXPECT_LT((body_velocity(filter, Vector3d::Zero(), Vector3d::Zero()) - wheels).norm(), 0.05);
}

TEST(Eskf18, takes_a_yaw_across_the_wrap) {
  Eskf18 filter;
  filter.q_map_base = from_yaw(3.1);
  filter.P *= 0.01;
  update_yaw(filter, -3.1, 0.1);
  EXPECT_NEAR(std::abs(yaw(filter)), M_PI, 0.01);
}

// ---- frames -------------------------------------------------------------------------------------

TEST(Eskf18, is_the_same_state_after_a_change_of_frame_and_back) {
  std::mt19937_64 random(5);
  Eskf18 filter = random_filter(random);
  predict(filter, random_imu(random), 0.2, 0.02, some_noise());
  const Eskf18 before = filter;
  const Matrix3d R = so3_exp({0.001, -0.002, 0.3}).toRotationMatrix();
  const Vector3d t(10.0, -20.0, 3.0);
  change_frame(filter, R, t);
  EXPECT_LT((filter.p_map_m - (R * before.p_map_m + t)).norm(), 1e-9);
  change_frame(filter, R.transpose(), -R.transpose() * t);
  EXPECT_LT(difference(filter, before).norm(), 1e-9);
  EXPECT_LT((filter.P - before.P).norm(), 1e-8);
}

TEST(Eskf18, turns_its_heading_and_keeps_what_it_knows_of_the_tilt) {
  std::mt19937_64 random(6);
  Eskf18 filter;
  filter.q_map_base = from_roll_pitch_yaw({0.1, -0.05, 0.3});
  filter.P.block<3, 3>(ins::kRotation, ins::kRotation) *= 1e-4;
  set_heading(filter, 1.0, 0.2);
  const Vector3d rpy = roll_pitch_yaw_of(filter.q_map_base);
  EXPECT_LT((rpy - Vector3d(0.1, -0.05, 1.3)).norm(), 1e-9);
  const Matrix3d R = filter.R_map_base();
  const Matrix3d about_map =
      R * filter.P.block<3, 3>(ins::kRotation, ins::kRotation) * R.transpose();
  EXPECT_NEAR(std::sqrt(about_map(2, 2)), 0.2, 1e-9);
  EXPECT_NEAR(std::sqrt(about_map(0, 0)), 0.01, 1e-9);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
