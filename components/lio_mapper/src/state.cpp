// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "state.hpp"

#include "trigpoint/base/so3.hpp"

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

bool State::is_finite() const {
  return T_odom_base.is_finite() && v_odom_mps.allFinite() && gyro_bias_radps.allFinite() &&
         accel_bias_mps2.allFinite() && gravity_odom_mps2.allFinite() && T_map_odom.p.allFinite() &&
         std::isfinite(T_map_odom.yaw_rad) && T_base_lidar.is_finite();
}

Eigen::Matrix<double, 3, 2> gravity_tangent(const Vector3d& gravity) {
  // Smooth everywhere but at straight up, which gravity never is.
  return rotation_between(-Vector3d::UnitZ(), gravity).toRotationMatrix().leftCols<2>();
}

State boxplus(const State& state, const ErrorVector& e) {
  State moved = state;
  moved.T_odom_base.p += e.segment<3>(error::kPosition);
  moved.T_odom_base.q =
      (state.T_odom_base.q * so3_exp(e.segment<3>(error::kRotation))).normalized();
  moved.T_base_lidar.p += e.segment<3>(error::kExtrinsicPosition);
  moved.T_base_lidar.q =
      (state.T_base_lidar.q * so3_exp(e.segment<3>(error::kExtrinsicRotation))).normalized();
  moved.v_odom_mps += e.segment<3>(error::kVelocity);
  moved.gyro_bias_radps += e.segment<3>(error::kGyroBias);
  moved.accel_bias_mps2 += e.segment<3>(error::kAccelBias);
  const Vector3d turn = gravity_tangent(state.gravity_odom_mps2) * e.segment<2>(error::kGravity);
  moved.gravity_odom_mps2 = so3_exp(turn) * state.gravity_odom_mps2;
  moved.T_map_odom.yaw_rad = wrap_angle(state.T_map_odom.yaw_rad + e[error::kYawMapOdom]);
  moved.T_map_odom.p += e.segment<3>(error::kPositionMapOdom);
  return moved;
}

YawPose State::placement() const {
  YawPose placed = T_map_odom;
  placed.tilt_rad = so3_log(rotation_between(gravity_odom_mps2, -Vector3d::UnitZ())).head<2>();
  return placed;
}

Eigen::Matrix2d tilt_by_gravity(const Vector3d& gravity_odom_mps2) {
  // With u the direction of up in odom, tilt = f(u_z) (u_y, -u_x), f(c) = acos(c) / sqrt(1 - c^2),
  // and a gravity error e turns u by (B e) x u, B the tangent.
  const Vector3d u = -gravity_odom_mps2.normalized();
  const double sine2 = u.head<2>().squaredNorm();
  const double sine = std::sqrt(sine2);
  constexpr double kSmall = 1e-4;
  const double f = sine < kSmall ? 1.0 + sine2 / 6.0 : std::atan2(sine, u.z()) / sine;
  const double slope = sine < kSmall ? -1.0 / 3.0 : (u.z() * f - 1.0) / sine2;
  Eigen::Matrix<double, 2, 3> tilt_by_up;
  tilt_by_up << 0.0, f, slope * u.y(), -f, 0.0, -slope * u.x();
  return tilt_by_up * -hat(u) * gravity_tangent(gravity_odom_mps2);
}

Eigen::Matrix<double, 3, 2> placed_point_by_gravity(const State& state, const Vector3d& p_odom_m) {
  const YawPose placed = state.placement();
  const Vector3d tilt{placed.tilt_rad.x(), placed.tilt_rad.y(), 0.0};
  return -(placed.pose().q.toRotationMatrix() * hat(p_odom_m) * so3_right_jacobian(tilt))
              .leftCols<2>() *
         tilt_by_gravity(state.gravity_odom_mps2);
}

ErrorVector boxminus(const State& to, const State& from) {
  ErrorVector e;
  e.segment<3>(error::kPosition) = to.T_odom_base.p - from.T_odom_base.p;
  e.segment<3>(error::kRotation) = so3_log(from.T_odom_base.q.conjugate() * to.T_odom_base.q);
  e.segment<3>(error::kExtrinsicRotation) =
      so3_log(from.T_base_lidar.q.conjugate() * to.T_base_lidar.q);
  e.segment<3>(error::kExtrinsicPosition) = to.T_base_lidar.p - from.T_base_lidar.p;
  e.segment<3>(error::kVelocity) = to.v_odom_mps - from.v_odom_mps;
  e.segment<3>(error::kGyroBias) = to.gyro_bias_radps - from.gyro_bias_radps;
  e.segment<3>(error::kAccelBias) = to.accel_bias_mps2 - from.accel_bias_mps2;
  const Vector3d turn = so3_log(rotation_between(from.gravity_odom_mps2, to.gravity_odom_mps2));
  e.segment<2>(error::kGravity) = gravity_tangent(from.gravity_odom_mps2).transpose() * turn;
  e[error::kYawMapOdom] = wrap_angle(to.T_map_odom.yaw_rad - from.T_map_odom.yaw_rad);
  e.segment<3>(error::kPositionMapOdom) = to.T_map_odom.p - from.T_map_odom.p;
  return e;
}

PriorJacobian prior_jacobian(const State& state,
                             const State& prior,
                             const ErrorVector& difference) {
  PriorJacobian jacobian;
  const Vector3d rotation = difference.segment<3>(error::kRotation);
  jacobian.rotation = so3_right_jacobian_inverse(rotation);
  jacobian.inverse_rotation = so3_right_jacobian(rotation);
  jacobian.inverse_extrinsic_rotation =
      so3_right_jacobian(difference.segment<3>(error::kExtrinsicRotation));
  jacobian.gravity = gravity_tangent(prior.gravity_odom_mps2).transpose() *
                     gravity_tangent(state.gravity_odom_mps2);
  jacobian.inverse_gravity = jacobian.gravity.inverse();
  return jacobian;
}

ErrorVector to_tangent_of_state(const PriorJacobian& jacobian, const ErrorVector& e) {
  ErrorVector turned = e;
  turned.segment<3>(error::kRotation) = jacobian.inverse_rotation * e.segment<3>(error::kRotation);
  turned.segment<3>(error::kExtrinsicRotation) =
      jacobian.inverse_extrinsic_rotation * e.segment<3>(error::kExtrinsicRotation);
  turned.segment<2>(error::kGravity) = jacobian.inverse_gravity * e.segment<2>(error::kGravity);
  return turned;
}

ErrorMatrix transition_to_tangent_of_state(const PriorJacobian& jacobian,
                                           const ErrorMatrix& transition) {
  ErrorMatrix turned = transition;
  turned.middleRows<3>(error::kRotation) =
      jacobian.inverse_rotation * transition.middleRows<3>(error::kRotation);
  turned.middleRows<3>(error::kExtrinsicRotation) =
      jacobian.inverse_extrinsic_rotation * transition.middleRows<3>(error::kExtrinsicRotation);
  turned.middleRows<2>(error::kGravity) =
      jacobian.inverse_gravity * transition.middleRows<2>(error::kGravity);
  return turned;
}

ErrorMatrix to_tangent_of_state(const PriorJacobian& jacobian, const ErrorMatrix& covariance) {
  const ErrorMatrix half = transition_to_tangent_of_state(jacobian, covariance);
  return transition_to_tangent_of_state(jacobian, half.transpose());
}

void make_symmetric(ErrorMatrix& covariance) {
  covariance = 0.5 * (covariance + covariance.transpose()).eval();
}

State with_odom_moved(const State& state, const Pose& T_odom_base_wanted) {
  const double turn_rad = wrap_angle(yaw_of(T_odom_base_wanted.q) - yaw_of(state.T_odom_base.q));
  const Quaterniond q_new_old = from_yaw(turn_rad);
  const Vector3d p_new_old = T_odom_base_wanted.p - q_new_old * state.T_odom_base.p;
  State moved = state;
  moved.T_odom_base = {(q_new_old * state.T_odom_base.q).normalized(), T_odom_base_wanted.p};
  moved.v_odom_mps = q_new_old * state.v_odom_mps;
  moved.gravity_odom_mps2 = q_new_old * state.gravity_odom_mps2;
  moved.T_map_odom.yaw_rad = wrap_angle(state.T_map_odom.yaw_rad - turn_rad);
  moved.T_map_odom.p -= moved.placement().pose().q * p_new_old;
  return moved;
}

}  // namespace trigpoint::lio_mapper
