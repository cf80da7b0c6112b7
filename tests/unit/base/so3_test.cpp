// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/so3.hpp"

#include "trigpoint/base/pose.hpp"

#include <gtest/gtest.h>
#include <unsupported/Eigen/MatrixFunctions>

#include <cmath>
#include <numbers>
#include <random>

namespace trigpoint {
namespace {

constexpr double kExact = 1e-12;
constexpr double kFiniteDifference = 1e-6;

Eigen::Vector3d random_vector(std::mt19937& generator, double scale) {
  std::normal_distribution<double> normal(0.0, scale);
  return {normal(generator), normal(generator), normal(generator)};
}

TEST(So3, exponential_equals_the_matrix_exponential) {
  std::mt19937 generator(1);
  for (const double scale : {1e-9, 1e-4, 0.1, 1.5}) {
    const Eigen::Vector3d a = random_vector(generator, scale);
    const Eigen::Matrix3d expected = Eigen::Matrix3d(hat(a).exp());
    EXPECT_LT((so3_exp(a).toRotationMatrix() - expected).norm(), kExact) << "scale " << scale;
  }
}

TEST(So3, logarithm_inverts_the_exponential_up_to_half_a_turn) {
  std::mt19937 generator(2);
  for (const double angle : {0.0, 1e-10, 1e-6, 0.5, 3.0, std::numbers::pi - 1e-9}) {
    const Eigen::Vector3d a = angle * random_vector(generator, 1.0).normalized();
    EXPECT_LT((so3_log(so3_exp(a)) - a).norm(), 1e-9) << "angle " << angle;
  }
}

TEST(So3, logarithm_does_not_depend_on_the_quaternion_s_sign) {
  const Eigen::Quaterniond q = so3_exp({0.3, -0.2, 0.9});
  const Eigen::Quaterniond negative(-q.w(), -q.x(), -q.y(), -q.z());
  EXPECT_LT((so3_log(q) - so3_log(negative)).norm(), kExact);
}

TEST(So3, right_jacobian_equals_finite_differences) {
  std::mt19937 generator(3);
  for (const double scale : {1e-5, 0.05, 1.0}) {
    const Eigen::Vector3d a = random_vector(generator, scale);
    Eigen::Matrix3d numeric;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d step = Eigen::Vector3d::Unit(i) * kFiniteDifference;
      numeric.col(i) = (so3_log(so3_exp(a).conjugate() * so3_exp(a + step)) -
                        so3_log(so3_exp(a).conjugate() * so3_exp(a - step))) /
                       (2.0 * kFiniteDifference);
    }
    EXPECT_LT((so3_right_jacobian(a) - numeric).norm(), 1e-8) << "scale " << scale;
    EXPECT_LT((so3_right_jacobian(a) * so3_right_jacobian_inverse(a) - Eigen::Matrix3d::Identity())
                  .norm(),
              1e-9);
  }
}

TEST(So3, roll_pitch_yaw_round_trips_and_yaw_is_the_heading_of_the_x_axis) {
  const Eigen::Vector3d rpy(0.1, -0.7, 2.9);
  const Eigen::Quaterniond q = from_roll_pitch_yaw(rpy);
  EXPECT_LT((roll_pitch_yaw_of(q) - rpy).norm(), kExact);
  const Eigen::Vector3d x_axis = q * Eigen::Vector3d::UnitX();
  EXPECT_NEAR(yaw_of(q), std::atan2(x_axis.y(), x_axis.x()), kExact);
}

TEST(So3, wrapped_angles_lie_above_minus_pi_and_at_most_at_pi) {
  EXPECT_NEAR(wrap_angle(3.0 * std::numbers::pi), std::numbers::pi, kExact);
  EXPECT_NEAR(wrap_angle(-std::numbers::pi), std::numbers::pi, kExact);
  EXPECT_NEAR(wrap_angle(7.0), 7.0 - 2.0 * std::numbers::pi, kExact);
}

TEST(Pose, composition_equals_applying_one_after_the_other) {
  const Pose a(so3_exp({0.1, 0.2, -0.4}), {1.0, -2.0, 3.0});
  const Pose b(so3_exp({-0.7, 0.3, 0.2}), {0.5, 0.1, -9.0});
  const Eigen::Vector3d point(4.0, 5.0, 6.0);
  EXPECT_LT(((a * b) * point - a * (b * point)).norm(), 1e-11);
  EXPECT_LT(((a * a.inverse()) * point - point).norm(), 1e-11);
}

TEST(Pose, interpolation_half_way_turns_half_the_angle) {
  const Pose from;
  const Pose to(from_yaw(1.0), {2.0, 0.0, 4.0});
  const Pose middle = interpolate(from, to, 0.5);
  EXPECT_NEAR(yaw_of(middle.q), 0.5, kExact);
  EXPECT_LT((middle.p - Eigen::Vector3d(1.0, 0.0, 2.0)).norm(), kExact);
}

}  // namespace
}  // namespace trigpoint
