// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "state.hpp"

#include "trigpoint/base/so3.hpp"

#include "random_state.hpp"
#include <gtest/gtest.h>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::random_error;
using testing_support::random_state;

TEST(State, boxminus_undoes_boxplus) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const State state = random_state(seed);
    const ErrorVector e = random_error(seed, 0.3);
    EXPECT_LT((boxminus(boxplus(state, e), state) - e).norm(), 1e-9);
  }
}

TEST(State, gravity_keeps_its_magnitude_when_its_direction_is_corrected) {
  const State state = random_state(3);
  const State moved = boxplus(state, random_error(4, 0.5));
  EXPECT_NEAR(moved.gravity_odom_mps2.norm(), state.gravity_odom_mps2.norm(), 1e-12);
  EXPECT_GT((moved.gravity_odom_mps2 - state.gravity_odom_mps2).norm(), 0.1);
}

TEST(State, prior_jacobian_equals_the_numerical_one) {
  const State prior = random_state(5);
  ErrorVector offset = random_error(6, 0.4);
  // The gravity block is exact to first order of the difference only, which is below 1e-3 a scan.
  offset.segment<2>(error::kGravity) *= 1e-3;
  const State state = boxplus(prior, offset);
  const ErrorVector difference = boxminus(state, prior);
  const PriorJacobian jacobian = prior_jacobian(state, prior, difference);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < error::kSize; ++i) {
    ErrorVector e = ErrorVector::Zero();
    e[i] = kStep;
    const ErrorVector numerical = (boxminus(boxplus(state, e), prior) - difference) / kStep;
    const ErrorVector back = to_tangent_of_state(jacobian, numerical);
    EXPECT_LT((back - e / kStep).norm(), 2e-5) << "column " << i;
  }
}

TEST(State, placement_turns_gravity_straight_down) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const State state = random_state(seed);
    const Pose T_map_odom = state.placement().pose();
    const Eigen::Vector3d down = T_map_odom.q * state.gravity_odom_mps2.normalized();
    EXPECT_LT((down + Eigen::Vector3d::UnitZ()).norm(), 1e-12) << "seed " << seed;
    EXPECT_LT((T_map_odom.p - state.T_map_odom.p).norm(), 1e-15);
  }
}

TEST(State, tilt_and_placed_point_move_with_gravity_as_numerical_differences_say) {
  constexpr double kStep = 1e-5;
  const Eigen::Vector3d p_odom_m{30.0, -20.0, 4.0};
  State level;  // the closed form has a removable singularity there
  for (const State& state : {random_state(11), random_state(12), level}) {
    const Eigen::Matrix2d tilt = tilt_by_gravity(state.gravity_odom_mps2);
    const auto point = placed_point_by_gravity(state, p_odom_m);
    for (int i = 0; i < 2; ++i) {
      ErrorVector e = ErrorVector::Zero();
      e[error::kGravity + i] = kStep;
      const YawPose plus = boxplus(state, e).placement();
      const YawPose minus = boxplus(state, -e).placement();
      EXPECT_LT((tilt.col(i) - (plus.tilt_rad - minus.tilt_rad) / (2.0 * kStep)).norm(), 1e-8);
      const Eigen::Vector3d moved_m = plus.pose() * p_odom_m - minus.pose() * p_odom_m;
      EXPECT_LT((point.col(i) - moved_m / (2.0 * kStep)).norm(), 1e-6);
    }
  }
}

TEST(State, moving_odom_keeps_what_the_pose_is_in_map_and_what_is_seen_from_the_robot) {
  const State state = random_state(7);
  const Pose wanted = boxplus(state, random_error(8, 0.2)).T_odom_base;
  const State moved = with_odom_moved(state, wanted);
  EXPECT_LT((moved.T_odom_base.p - wanted.p).norm(), 1e-12);
  EXPECT_NEAR(yaw_of(moved.T_odom_base.q), yaw_of(wanted.q), 1e-12);
  const Pose before = state.placement().pose() * state.T_odom_base;
  const Pose after = moved.placement().pose() * moved.T_odom_base;
  EXPECT_LT((before.p - after.p).norm(), 1e-9);
  EXPECT_LT(before.q.angularDistance(after.q), 1e-9);
  const Eigen::Vector3d v_before = state.T_odom_base.q.conjugate() * state.v_odom_mps;
  const Eigen::Vector3d v_after = moved.T_odom_base.q.conjugate() * moved.v_odom_mps;
  EXPECT_LT((v_before - v_after).norm(), 1e-9);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
