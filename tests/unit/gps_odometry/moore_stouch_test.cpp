// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the published filter does, its defects included: they are why it is not the default.
#include "moore_stouch.hpp"

#include "measured_states.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kStrictNumericalStep = 1e-6;
constexpr double kStrictJacobianTolerance = 1e-7;  // central differences of values up to some tens
constexpr double kRoundOff = 1e-12;

MooreStouch started() {
  MooreStouch filter;
  filter.initialised = true;
  return filter;
}

StrictOutcome measure(MooreStouch& filter, int state, double value, double variance) {
  Vector15d z = Vector15d::Zero();
  Matrix15d R = Matrix15d::Identity();
  z(state) = value;
  R(state, state) = variance;
  return filter.correct(z, R, states({state}));
}

Vector15d random_strict_state(std::mt19937_64& random) {
  std::uniform_real_distribution<double> one(-1.0, 1.0);
  Vector15d x;
  for (double& value : x) {
    value = one(random);
  }
  x.segment<3>(kPosition) *= 10.0;
  x.segment<3>(kAttitude) = x.segment<3>(kAttitude).cwiseProduct(Eigen::Vector3d(3.1, 1.2, 3.1));
  x.segment<3>(kVelocity) *= 10.0;
  x.segment<3>(kRate) *= 3.0;
  x.segment<3>(kAcceleration) *= 5.0;
  return x;
}

TEST(Ekf15Strict, has_the_jacobian_of_its_motion_model) {
  std::mt19937_64 random(1);
  double worst = 0.0;
  for (int n = 0; n < 500; ++n) {
    const Vector15d x = random_strict_state(random);
    const double dt_s = 0.001 + 0.0005 * n;
    Matrix15d numerical;
    for (int i = 0; i < 15; ++i) {
      const Vector15d step = kStrictNumericalStep * Vector15d::Unit(i);
      numerical.col(i) = (moore_stouch_model(x + step, dt_s) - moore_stouch_model(x - step, dt_s)) /
                         (2.0 * kStrictNumericalStep);
    }
    worst = std::max(worst, (moore_stouch_jacobian(x, dt_s) - numerical).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(worst, kStrictJacobianTolerance);
  std::printf("500 random states: analytic and numerical Jacobian differ by %.1e at most\n", worst);
}

TEST(Ekf15Strict, moves_along_its_heading_with_velocity_and_acceleration) {
  MooreStouch filter = started();
  filter.x(kAttitude + 2) = M_PI / 2.0;
  filter.x(kVelocity) = 3.0;
  filter.x(kAcceleration) = 2.0;
  filter.predict(0.5);
  EXPECT_NEAR(filter.x(kPosition), 0.0, kRoundOff);
  EXPECT_NEAR(filter.x(kPosition + 1), 3.0 * 0.5 + 0.5 * 2.0 * 0.25, kRoundOff);
  EXPECT_NEAR(filter.x(kVelocity), 4.0, kRoundOff);
}

TEST(Ekf15Strict, keeps_angles_within_pi_in_prediction_and_update) {
  MooreStouch filter = started();
  filter.x(kAttitude + 2) = 3.0;
  filter.x(kRate + 2) = 1.0;
  filter.predict(0.5);
  EXPECT_NEAR(filter.x(kAttitude + 2), 3.5 - 2.0 * M_PI, kRoundOff);
  filter.P = Matrix15d::Identity();
  filter.x(kAttitude + 2) = 3.1;
  measure(filter, kAttitude + 2, -3.1, 1.0);  // 0.083 rad ahead, not 6.2 behind
  EXPECT_NEAR(std::abs(filter.x(kAttitude + 2)), M_PI, kRoundOff);
}

TEST(Ekf15Strict, averages_equal_measurements_as_independent_ones) {
  MooreStouch filter = started();
  filter.P = 4.0 * Matrix15d::Identity();
  for (int i = 0; i < 100; ++i) {
    measure(filter, kPosition, 1.0, 4.0);  // the same fix with the same stamp
  }
  EXPECT_NEAR(filter.P(0, 0), 4.0 / 101.0, kRoundOff);  // duplicates are new information to it
}

TEST(Ekf15Strict, is_accurate_where_the_short_form_of_the_covariance_is_not) {
  // (I - K H) P alone loses this variance in round-off: 1 - K is known to 1e-16 only.
  MooreStouch filter = started();
  filter.P(0, 0) = 1e8;
  measure(filter, kPosition, 1.0, 1e-8);
  EXPECT_NEAR(filter.P(0, 0) / 1e-8, 1.0, 1e-9);
}

TEST(Ekf15Strict, keeps_its_covariance_positive) {
  std::mt19937_64 random(2);
  MooreStouch filter = started();
  for (int n = 0; n < 500; ++n) {
    filter.predict(0.02);
    filter.correct(
        Vector15d::Random(), 0.01 * Matrix15d::Identity(), MeasuredStates(random() & 0x7fff));
  }
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix15d>(filter.P).eigenvalues()(0), 0.0);
}

TEST(Ekf15Strict, copies_the_first_measurement_as_it_is) {
  MooreStouch filter;
  Vector15d z = Vector15d::Constant(5.0);
  const Matrix15d R = 0.25 * Matrix15d::Identity() + Matrix15d::Constant(0.01);
  EXPECT_EQ(filter.correct(z, R, states({0, 5})), StrictOutcome::kInitialised);
  EXPECT_EQ(filter.x, 5.0 * (Vector15d::Unit(0) + Vector15d::Unit(5)));
  EXPECT_EQ(filter.P(0, 0), R(0, 0));
  EXPECT_EQ(filter.P(0, 5), R(0, 5));
  EXPECT_EQ(filter.P(1, 1), kPublishedInitialVariance);
  EXPECT_EQ(filter.P(0, 1), 0.0);
}

TEST(Ekf15Strict, leaves_out_values_that_are_not_finite) {
  MooreStouch filter = started();
  MooreStouch reference = started();
  filter.P = reference.P = Matrix15d::Identity() + Matrix15d::Constant(0.1);
  Vector15d z = Vector15d::Ones();
  z(1) = kNaN;
  z(2) = HUGE_VAL;
  filter.correct(z, Matrix15d::Identity(), states({0, 1, 2}));
  reference.correct(z, Matrix15d::Identity(), states({0}));
  EXPECT_EQ(filter.x, reference.x);
  EXPECT_EQ(filter.P, reference.P);
  EXPECT_EQ(filter.correct(z, Matrix15d::Identity(), states({1, 2})),
            StrictOutcome::kNothingMeasured);
}

TEST(Ekf15Strict, takes_a_negative_variance_as_positive_and_zero_as_nearly_perfect) {
  MooreStouch negative = started();
  MooreStouch positive = started();
  negative.P = positive.P = Matrix15d::Identity();
  measure(negative, kPosition, 1.0, -4.0);
  measure(positive, kPosition, 1.0, 4.0);
  EXPECT_EQ(negative.x, positive.x);
  EXPECT_EQ(negative.P, positive.P);

  MooreStouch zero = started();
  zero.P = Matrix15d::Identity();
  measure(zero, kPosition, 100.0, 0.0);  // a fix of unknown covariance
  EXPECT_NEAR(zero.x(0), 100.0, 1e-6);
  EXPECT_NEAR(zero.P(0, 0) / 1e-9, 1.0, 1e-6);
}

TEST(Ekf15Strict, refuses_a_whole_measurement_beyond_its_gate_only_when_asked) {
  MooreStouch filter = started();
  filter.P = 3.0 * Matrix15d::Identity();
  filter.gate_sigmas = 2.5;  // S = 3 + 1, so 5 m are 2.5 sigma
  EXPECT_EQ(measure(filter, kPosition, 5.0, 1.0), StrictOutcome::kRefusedByGate);
  EXPECT_EQ(filter.x, Vector15d(Vector15d::Zero()));
  EXPECT_EQ(measure(filter, kPosition, 4.999, 1.0), StrictOutcome::kFused);
  filter.gate_sigmas.reset();
  EXPECT_EQ(measure(filter, kPosition, 1e6, 1.0), StrictOutcome::kFused);
}

// The published defects (numbers of the published filter itself in each).

struct Circle {
  double sideways_mps;
  double position_error_m;
};

/// 10 s of a circle with 2 m/s and 0.5 rad/s: forward speed and yaw rate are measured perfectly,
/// and the true centripetal acceleration as well if asked.
Circle drive_a_circle(bool with_sideways_acceleration) {
  constexpr double kSpeed_mps = 2.0;
  constexpr double kYawRate_radps = 0.5;
  MooreStouch filter = started();
  Vector15d z = Vector15d::Zero();
  z(kVelocity) = filter.x(kVelocity) = kSpeed_mps;
  z(kRate + 2) = filter.x(kRate + 2) = kYawRate_radps;
  z(kAcceleration + 1) = kSpeed_mps * kYawRate_radps;
  MeasuredStates measured = states({kVelocity, kRate + 2});
  measured[kAcceleration + 1] = with_sideways_acceleration;
  for (int i = 0; i < 1000; ++i) {
    filter.predict(0.01);
    filter.correct(z, 1e-4 * Matrix15d::Identity(), measured);
  }
  const double radius = kSpeed_mps / kYawRate_radps;
  const double angle = kYawRate_radps * 10.0;
  const Eigen::Vector2d truth(radius * std::sin(angle), radius * (1.0 - std::cos(angle)));
  return {filter.x(kVelocity + 1), (filter.x.head<2>() - truth).norm()};
}

TEST(Ekf15Strict, drifts_out_of_a_circle_when_the_true_acceleration_is_fused) {
  const Circle without = drive_a_circle(false);
  EXPECT_LT(without.position_error_m, 0.05);  // published: 0.016 m
  const Circle with = drive_a_circle(true);
  // v' = v + a dt without w x v: the body is believed to slide sideways with v w t = 10 m/s, and
  // its position with the double integral of a turning acceleration.
  EXPECT_NEAR(with.sideways_mps, 10.0, 0.1);  // published: 9.96 m/s, true 0
  EXPECT_GT(with.position_error_m, 20.0);     // published: 23.95 m
  std::printf("circle: sideways %.2f m/s, %.2f m off; without the acceleration %.3f m off\n",
              with.sideways_mps,
              with.position_error_m,
              without.position_error_m);
}

/// Variance of position after one prediction over t from variances P0 = p I at rest:
/// p (1 + t^2 + t^4 / 4) + q_p t.
TEST(Ekf15Strict, knows_its_position_better_the_fewer_steps_it_predicts_in) {
  MooreStouch at_once = started();
  at_once.P = 1e-6 * Matrix15d::Identity();
  MooreStouch in_steps = at_once;
  at_once.predict(60.0);
  for (int i = 0; i < 6000; ++i) {
    in_steps.predict(0.01);
  }
  const double t = 60.0;
  const double once_m2 = 1e-6 * (1.0 + t * t + std::pow(t, 4) / 4.0) + 0.05 * t;
  // The limit of small steps: q_p t + q_v t^3 / 3 + q_a t^5 / 20 more than the variances carried
  // on.
  const double steps_m2 = once_m2 + 0.025 * std::pow(t, 3) / 3.0 + 0.01 * std::pow(t, 5) / 20.0;
  EXPECT_NEAR(std::sqrt(at_once.P(0, 0)), std::sqrt(once_m2), kRoundOff);     // 2.5 m
  EXPECT_NEAR(std::sqrt(in_steps.P(0, 0)) / std::sqrt(steps_m2), 1.0, 1e-3);  // 625 m
  std::printf("60 s without input: sigma %.2f m in one step, %.1f m in 6000\n",
              std::sqrt(at_once.P(0, 0)),
              std::sqrt(in_steps.P(0, 0)));
}

TEST(Ekf15Strict, never_recovers_from_a_first_measurement_that_is_not_a_number) {
  MooreStouch filter;
  measure(filter, kPosition, kNaN, 1.0);
  for (int i = 0; i < 10; ++i) {
    filter.predict(0.1);
    measure(filter, kPosition, 1.0, 1.0);
  }
  EXPECT_TRUE(std::isnan(filter.x(0)));
}

TEST(Ekf15Strict, never_recovers_from_a_covariance_that_is_not_a_number) {
  MooreStouch filter = started();
  measure(filter, kPosition, 1.0, kNaN);
  measure(filter, kPosition, 1.0, 1.0);
  EXPECT_TRUE(std::isnan(filter.x(0)));
}

TEST(Ekf15Strict, moves_away_from_a_measurement_with_an_indefinite_covariance) {
  MooreStouch filter = started();
  filter.P = Matrix15d::Identity();
  Matrix15d R = Matrix15d::Identity();
  R(0, 1) = R(1, 0) = 5.0;
  filter.correct(Vector15d::Unit(0), R, states({0, 1}));
  EXPECT_NEAR(filter.x(0), 2.0 / (2.0 * 2.0 - 5.0 * 5.0), kRoundOff);  // published: -0.10
}

TEST(Ekf15Strict, is_all_but_infinitely_unsure_of_yaw_at_pitch_ninety_degrees) {
  MooreStouch filter = started();
  filter.x(kAttitude + 1) = M_PI / 2.0;
  filter.P = Matrix15d::Identity();
  for (int i = 0; i < 2; ++i) {
    filter.predict(0.1);
  }
  EXPECT_GT(filter.P(kAttitude + 2, kAttitude + 2), 1e20);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
