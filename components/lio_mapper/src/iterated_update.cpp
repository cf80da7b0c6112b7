// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "iterated_update.hpp"

#include <Eigen/LU>

#include <algorithm>

namespace trigpoint::lio_mapper {

namespace {

using Gain = Eigen::Matrix<double, error::kSize, error::kPose>;

/// P_{:,6} (I + A P_66)^-1.
Gain gain_of(const ErrorMatrix& covariance, const Matrix6d& information) {
  const Matrix6d system =
      Matrix6d::Identity() + information * covariance.topLeftCorner<error::kPose, error::kPose>();
  // X system = P_{:,6}  <=>  system^T X^T = P_{:,6}^T
  return system.transpose()
      .partialPivLu()
      .solve(covariance.leftCols<error::kPose>().transpose())
      .transpose();
}

bool is_small(const ErrorVector& step, const IterationLimits& limits) {
  return step.segment<3>(error::kPosition).norm() < limits.converged_position_m &&
         step.segment<3>(error::kRotation).norm() < limits.converged_rotation_rad;
}

/// Variances along odom's axes of position and of rotation.
Vector6d axis_variances(const ErrorMatrix& covariance, const State& state) {
  const Eigen::Matrix3d R = state.T_odom_base.q.toRotationMatrix();
  Vector6d variances;
  variances.head<3>() = covariance.diagonal().segment<3>(error::kPosition);
  variances.tail<3>() =
      (R * covariance.block<3, 3>(error::kRotation, error::kRotation) * R.transpose()).diagonal();
  return variances;
}

std::array<double, 6> share_removed(const Vector6d& before, const Vector6d& after) {
  std::array<double, 6> share{};
  for (int i = 0; i < 6; ++i) {
    share[static_cast<std::size_t>(i)] =
        before[i] > 0.0 ? std::clamp(1.0 - after[i] / before[i], 0.0, 1.0) : 0.0;
  }
  return share;
}

UpdateResult unused(const State& prior, const ErrorMatrix& covariance) {
  UpdateResult result;
  result.state = prior;
  result.covariance = covariance;
  return result;
}

}  // namespace

UpdateResult iterated_update(const State& prior,
                             const ErrorMatrix& covariance,
                             const std::function<PoseInformation(const Pose&)>& linearise,
                             const IterationLimits& limits) {
  UpdateResult result;
  result.state = prior;
  result.covariance = covariance;
  State state = prior;
  while (result.iterations < limits.max_iterations && !result.converged) {
    const PoseInformation measured = linearise(state.T_odom_base);
    if (measured.count < limits.min_count) {
      return unused(prior, covariance);
    }
    const ErrorVector difference = boxminus(state, prior);
    const PriorJacobian jacobian = prior_jacobian(state, prior, difference);
    const ErrorVector back = to_tangent_of_state(jacobian, difference);
    const ErrorMatrix P = to_tangent_of_state(jacobian, covariance);
    const Gain gain = gain_of(P, measured.information);
    const ErrorVector step =
        -gain * (measured.gradient - measured.information * back.head<error::kPose>()) - back;
    result.measured = measured;
    result.measured_at = state.T_odom_base;
    state = boxplus(state, step);
    result.count = measured.count;
    result.converged = is_small(step, limits);
    ++result.iterations;
    if (result.converged || result.iterations == limits.max_iterations) {
      const ErrorMatrix to_state =
          transition_to_tangent_of_state(jacobian, ErrorMatrix::Identity());
      result.covariance = P - gain * measured.information * P.topRows<error::kPose>();
      result.transition = to_state - gain * measured.information * to_state.topRows<error::kPose>();
    }
  }
  make_symmetric(result.covariance);
  result.used = state.is_finite() && result.covariance.allFinite();
  if (!result.used) {
    return unused(prior, covariance);
  }
  result.state = state;
  result.observability =
      share_removed(axis_variances(covariance, prior), axis_variances(result.covariance, state));
  return result;
}

ErrorMatrix conditioned(const ErrorMatrix& covariance, const Matrix6d& information) {
  ErrorMatrix told = covariance - gain_of(covariance, information) * information *
                                      covariance.topRows<error::kPose>();
  make_symmetric(told);
  return told;
}

}  // namespace trigpoint::lio_mapper
