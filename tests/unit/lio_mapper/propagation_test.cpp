// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "propagation.hpp"

#include "trigpoint/base/so3.hpp"

#include "random_state.hpp"
#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::random_covariance;
using testing_support::random_state;

const InertialStep kInertialStep{{0, {0.4, -0.7, 1.1}, {1.0, -2.0, 9.0}},
                                 {10'000'000, {0.5, -0.6, 1.3}, {1.5, -2.5, 10.0}}};

ErrorMatrix transition_of(const StepJacobian& jacobian) {
  ErrorMatrix F = ErrorMatrix::Identity();
  apply_transition(jacobian, F);
  return F;
}

TEST(Propagation, transition_equals_the_numerical_one) {
  constexpr double kDelta = 1e-6;
  constexpr double kTolerance = 2e-6;  // second-order terms of central differences, and rounding
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const State state = random_state(seed);
    const ErrorMatrix F = transition_of(step_jacobian(state, kInertialStep));
    const State nominal = propagate(state, kInertialStep);
    for (int i = 0; i < error::kSize; ++i) {
      ErrorVector e = ErrorVector::Zero();
      e[i] = kDelta;
      const ErrorVector column = (boxminus(propagate(boxplus(state, e), kInertialStep), nominal) -
                                  boxminus(propagate(boxplus(state, -e), kInertialStep), nominal)) /
                                 (2.0 * kDelta);
      EXPECT_LT((F.col(i) - column).norm(), kTolerance) << "column " << i << " seed " << seed;
    }
  }
}

TEST(Propagation, covariance_is_transported_by_the_transition_and_grows_by_the_noise) {
  const State state = random_state(2);
  const StepJacobian jacobian = step_jacobian(state, kInertialStep);
  const ErrorMatrix P = random_covariance(3, 0.1);
  const ErrorMatrix F = transition_of(jacobian);
  ImuConfig noise;
  ErrorMatrix propagated = P;
  propagate_covariance(jacobian, noise, noise_of(noise, kInertialStep, 0.0), propagated);
  const ErrorMatrix Q = propagated - F * P * F.transpose();
  const double dt_s = kInertialStep.duration_s();
  const double accel2 = noise.accel_noise_mps2_sqrthz * noise.accel_noise_mps2_sqrthz;
  EXPECT_NEAR(Q(error::kVelocity, error::kVelocity), accel2 * dt_s, 1e-12);
  EXPECT_NEAR(Q(error::kPosition, error::kVelocity), accel2 * dt_s * dt_s / 2.0, 1e-12);
  EXPECT_NEAR(Q(error::kPosition, error::kPosition), accel2 * dt_s * dt_s * dt_s / 3.0, 1e-12);
  EXPECT_NEAR(Q(error::kYawMapOdom, error::kYawMapOdom), 0.0, 1e-12);
}

/// A velocity error of sigma T after a gap of T: what a turn or a braking in it would leave.
TEST(Propagation, over_a_gap_the_velocity_is_uncertain_by_a_motion_that_lasts) {
  const ImuConfig config;
  constexpr double kGap_s = 2.0;
  ErrorMatrix P = ErrorMatrix::Zero();
  State state;
  for (int i = 0; i < 100; ++i) {
    InertialStep step{{i * 20'000'000, {}, {0.0, 0.0, 9.80665}},
                      {(i + 1) * 20'000'000, {}, {0.0, 0.0, 9.80665}}};
    propagate_covariance(step_jacobian(state, step), config, noise_of(config, step, kGap_s), P);
    state = propagate(state, step);
  }
  const double speed_mps = config.gap_accel_mps2 * kGap_s;
  const double turn_rad = config.gap_gyro_radps * kGap_s;
  EXPECT_NEAR(std::sqrt(P(error::kRotation, error::kRotation)), turn_rad, 0.01 * turn_rad);
  // z: free of what the turn does to the direction of gravity.
  EXPECT_NEAR(
      std::sqrt(P(error::kVelocity + 2, error::kVelocity + 2)), speed_mps, 0.01 * speed_mps);
  EXPECT_NEAR(std::sqrt(P(error::kPosition + 2, error::kPosition + 2)),
              speed_mps * kGap_s / std::sqrt(3.0),
              0.01 * speed_mps * kGap_s);
  EXPECT_LT(noise_of(config, kInertialStep, config.max_gap_s).accel2, 1e-3);
}

/// A circle of 20 m at 8 m/s, level, sampled at 100 Hz: closed form in velocity and position.
TEST(Propagation, follows_a_circle_to_a_millimetre_over_ten_seconds) {
  constexpr double kRadius_m = 20.0;
  constexpr double kSpeed_mps = 8.0;
  constexpr double kRate_radps = kSpeed_mps / kRadius_m;
  State state;
  state.v_odom_mps = {kSpeed_mps, 0.0, 0.0};
  const auto sample = [&](Nanoseconds stamp_ns) {
    return InertialSample{
        stamp_ns, {0.0, 0.0, kRate_radps}, {0.0, kSpeed_mps * kRate_radps, 9.80665}};
  };
  constexpr Nanoseconds kPeriod_ns = 10'000'000;
  for (int i = 0; i < 1000; ++i) {
    state = propagate(state, {sample(i * kPeriod_ns), sample((i + 1) * kPeriod_ns)});
  }
  const double angle = kRate_radps * 10.0;
  const Eigen::Vector3d expected{
      kRadius_m * std::sin(angle), kRadius_m * (1.0 - std::cos(angle)), 0.0};
  EXPECT_LT((state.T_odom_base.p - expected).norm(), 1e-3);
  EXPECT_NEAR(yaw_of(state.T_odom_base.q), wrap_angle(angle), 1e-9);
}

TEST(Path, goes_on_between_and_beyond_its_nodes_as_the_motion_says) {
  Path path;
  path.push_back({0, {}, {1.0, 0.0, 0.0}, {2.0, 0.0, 0.0}, {0.0, 0.0, 0.5}});
  path.push_back({100'000'000,
                  {from_yaw(0.05), {0.11, 0.0, 0.0}},
                  {1.2, 0.0, 0.0},
                  Eigen::Vector3d::Zero(),
                  Eigen::Vector3d::Zero()});
  EXPECT_NEAR(path.at(50'000'000).p.x(), 0.05 + 0.5 * 2.0 * 0.05 * 0.05, 1e-12);
  EXPECT_NEAR(yaw_of(path.at(50'000'000).q), 0.025, 1e-12);
  EXPECT_NEAR(path.at(200'000'000).p.x(), 0.11 + 0.12, 1e-12);
  EXPECT_NEAR(path.at(-50'000'000).p.x(), -0.05 + 0.5 * 2.0 * 0.05 * 0.05, 1e-12);
}

/// A tenth of a second at 5 m/s in a turn of 0.8 rad/s, of which the gyro told 0.3 in its second
/// half.
TEST(Path, that_ends_elsewhere_bends_where_the_turn_was_uncertain) {
  constexpr double kSpeed_mps = 5.0;
  constexpr double kRate_radps = 0.8;
  constexpr double kTold_radps = 0.3;
  constexpr int kSteps = 20;
  constexpr double kStep_s = 0.005;
  const auto on_circle = [&](double angle) {
    const double radius_m = kSpeed_mps / kRate_radps;
    return Pose(from_yaw(angle),
                {radius_m * std::sin(angle), radius_m * (1.0 - std::cos(angle)), 0.0});
  };
  Path path;
  PathNode node;
  node.T_odom_base = on_circle(0.0);
  for (int i = 0; i <= kSteps; ++i) {
    const bool saturated = i >= kSteps / 2;
    const double rate_radps = saturated ? kTold_radps : kRate_radps;
    const double yaw = so3_log(node.T_odom_base.q).z();
    node.angular_radps = {0.0, 0.0, rate_radps};
    node.v_odom_mps = {kSpeed_mps * std::cos(yaw), kSpeed_mps * std::sin(yaw), 0.0};
    path.push_back(node);
    node.stamp_ns += from_seconds(kStep_s);
    node.turn_variance_rad2 += saturated ? 1.0 : 1e-4;
    node.T_odom_base.q = node.T_odom_base.q * from_yaw(rate_radps * kStep_s);
    node.T_odom_base.p += kStep_s * node.v_odom_mps;
  }
  const Path bent = path.ending_at(on_circle(kRate_radps * kSteps * kStep_s));
  for (double t_s = 0.0; t_s < kSteps * kStep_s; t_s += 0.001) {
    const Pose truth = on_circle(kRate_radps * t_s);
    const Pose pose = bent.at(from_seconds(t_s));
    EXPECT_LT(so3_log(truth.q.conjugate() * pose.q).norm(), 1e-4) << t_s;
    EXPECT_LT((truth.p - pose.p).norm(), 0.005) << t_s;
  }
  EXPECT_GT(
      so3_log(on_circle(kRate_radps * kSteps * kStep_s).q.conjugate() * path.back().T_odom_base.q)
          .norm(),
      0.02);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
