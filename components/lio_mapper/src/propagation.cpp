// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "propagation.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// Longer than this a robot or car keeps an acceleration or a turn rate.
constexpr double kMotionBuildsUp_s = 0.5;

/// The motion of one step: mean rate, and specific force at both ends without bias.
struct Motion {
  double dt_s;
  Vector3d angular_radps;
  Matrix3d R_begin;
  Matrix3d R_turn;
  Matrix3d R_end;
  Vector3d force_begin_mps2;
  Vector3d force_end_mps2;
  Vector3d acceleration_odom_mps2;
};

Motion motion_of(const State& state, const InertialStep& step) {
  Motion m;
  m.dt_s = step.duration_s();
  m.angular_radps = 0.5 * (step.begin.gyro_radps + step.end.gyro_radps) - state.gyro_bias_radps;
  m.R_begin = state.T_odom_base.q.toRotationMatrix();
  m.R_turn = so3_exp(m.angular_radps * m.dt_s).toRotationMatrix();
  m.R_end = m.R_begin * m.R_turn;
  m.force_begin_mps2 = step.begin.accel_mps2 - state.accel_bias_mps2;
  m.force_end_mps2 = step.end.accel_mps2 - state.accel_bias_mps2;
  m.acceleration_odom_mps2 =
      0.5 * (m.R_begin * m.force_begin_mps2 + m.R_end * m.force_end_mps2) + state.gravity_odom_mps2;
  return m;
}

}  // namespace

InertialSample interpolate(const InertialSample& a, const InertialSample& b, Nanoseconds stamp_ns) {
  if (b.stamp_ns <= a.stamp_ns) {
    return a;
  }
  const double fraction = to_seconds(stamp_ns - a.stamp_ns) / to_seconds(b.stamp_ns - a.stamp_ns);
  return {stamp_ns,
          a.gyro_radps + fraction * (b.gyro_radps - a.gyro_radps),
          a.accel_mps2 + fraction * (b.accel_mps2 - a.accel_mps2),
          a.saturated || b.saturated};
}

State propagate(const State& state, const InertialStep& step) {
  const Motion m = motion_of(state, step);
  State next = state;
  next.T_odom_base.p +=
      m.dt_s * state.v_odom_mps + 0.5 * m.dt_s * m.dt_s * m.acceleration_odom_mps2;
  next.T_odom_base.q = (state.T_odom_base.q * so3_exp(m.angular_radps * m.dt_s)).normalized();
  next.v_odom_mps += m.dt_s * m.acceleration_odom_mps2;
  return next;
}

StepJacobian step_jacobian(const State& state, const InertialStep& step) {
  const Motion m = motion_of(state, step);
  StepJacobian j;
  j.dt_s = m.dt_s;
  j.rotation = m.R_turn.transpose();
  j.rotation_gyro_bias = -m.dt_s * so3_right_jacobian(m.angular_radps * m.dt_s);
  const Matrix3d end_by_rotation = -0.5 * m.R_end * hat(m.force_end_mps2);
  j.accel_rotation = -0.5 * m.R_begin * hat(m.force_begin_mps2) + end_by_rotation * j.rotation;
  j.accel_gyro_bias = end_by_rotation * j.rotation_gyro_bias;
  j.accel_accel_bias = -0.5 * (m.R_begin + m.R_end);
  j.accel_gravity = -hat(state.gravity_odom_mps2) * gravity_tangent(state.gravity_odom_mps2);
  return j;
}

void apply_transition(const StepJacobian& j, ErrorMatrix& matrix) {
  using Rows3 = Eigen::Matrix<double, 3, error::kSize>;
  const Rows3 gyro_bias = matrix.middleRows<3>(error::kGyroBias);
  const Rows3 rotation = matrix.middleRows<3>(error::kRotation);
  const Rows3 velocity = matrix.middleRows<3>(error::kVelocity);
  const Rows3 acceleration = j.accel_rotation * rotation + j.accel_gyro_bias * gyro_bias +
                             j.accel_accel_bias * matrix.middleRows<3>(error::kAccelBias) +
                             j.accel_gravity * matrix.middleRows<2>(error::kGravity);
  matrix.middleRows<3>(error::kPosition) +=
      j.dt_s * velocity + (0.5 * j.dt_s * j.dt_s) * acceleration;
  matrix.middleRows<3>(error::kVelocity) += j.dt_s * acceleration;
  matrix.middleRows<3>(error::kRotation) = j.rotation * rotation + j.rotation_gyro_bias * gyro_bias;
}

StepNoise noise_of(const ImuConfig& config, const InertialStep& step, double gap_s) {
  const auto square = [](double x) { return x * x; };
  const double factor2 = square(step.noise_factor());
  StepNoise noise{factor2 * square(config.gyro_noise_radps_sqrthz),
                  factor2 * square(config.accel_noise_mps2_sqrthz)};
  if (gap_s > config.max_gap_s) {
    const double share2 = square(std::min(1.0, gap_s / kMotionBuildsUp_s));
    noise.gyro2 += share2 * square(config.gap_gyro_radps) * gap_s;
    noise.accel2 += share2 * square(config.gap_accel_mps2) * gap_s;
  }
  return noise;
}

void propagate_covariance(const StepJacobian& j,
                          const ImuConfig& config,
                          const StepNoise& noise,
                          ErrorMatrix& covariance) {
  apply_transition(j, covariance);
  covariance.transposeInPlace();
  apply_transition(j, covariance);
  const auto variance = [&](double density) { return density * density * j.dt_s; };
  const double accel = noise.accel2 * j.dt_s;
  // White specific force integrated once and twice over the step.
  for (int i = 0; i < 3; ++i) {
    covariance(error::kRotation + i, error::kRotation + i) += noise.gyro2 * j.dt_s;
    covariance(error::kVelocity + i, error::kVelocity + i) += accel;
    covariance(error::kPosition + i, error::kPosition + i) += accel * j.dt_s * j.dt_s / 3.0;
    covariance(error::kPosition + i, error::kVelocity + i) += accel * j.dt_s / 2.0;
    covariance(error::kVelocity + i, error::kPosition + i) += accel * j.dt_s / 2.0;
    covariance(error::kGyroBias + i, error::kGyroBias + i) +=
        variance(config.gyro_bias_walk_radps_sqrts);
    covariance(error::kAccelBias + i, error::kAccelBias + i) +=
        variance(config.accel_bias_walk_mps2_sqrts);
  }
}

Pose Path::at(Nanoseconds stamp_ns) const {
  const auto after = std::upper_bound(
      nodes_.begin(), nodes_.end(), stamp_ns, [](Nanoseconds stamp, const PathNode& node) {
        return stamp < node.stamp_ns;
      });
  const PathNode& node = after == nodes_.begin() ? nodes_.front() : *(after - 1);
  const double dt_s = to_seconds(stamp_ns - node.stamp_ns);
  return {(node.T_odom_base.q * so3_exp(node.angular_radps * dt_s)).normalized(),
          node.T_odom_base.p + dt_s * node.v_odom_mps +
              0.5 * dt_s * dt_s * node.acceleration_odom_mps2};
}

Path Path::ending_at(const Pose& T_odom_base) const {
  const PathNode& end = nodes_.back();
  const Vector3d turn_odom = so3_log(T_odom_base.q * end.T_odom_base.q.conjugate());
  const Vector3d shift_m = T_odom_base.p - end.T_odom_base.p;
  Path path = *this;
  for (PathNode& node : path.nodes_) {
    const double share =
        end.turn_variance_rad2 > 0.0 ? node.turn_variance_rad2 / end.turn_variance_rad2 : 1.0;
    node.T_odom_base.q = (so3_exp(share * turn_odom) * node.T_odom_base.q).normalized();
    node.T_odom_base.p += share * shift_m;
  }
  for (std::size_t i = 0; i + 1 < path.nodes_.size(); ++i) {
    PathNode& node = path.nodes_[i];
    const PathNode& next = path.nodes_[i + 1];
    const double dt_s = to_seconds(next.stamp_ns - node.stamp_ns);
    node.angular_radps = so3_log(node.T_odom_base.q.conjugate() * next.T_odom_base.q) / dt_s;
    node.v_odom_mps =
        (next.T_odom_base.p - node.T_odom_base.p) / dt_s - 0.5 * dt_s * node.acceleration_odom_mps2;
  }
  return path;
}

Path Path::seen_from(const Pose& T_base_other) const {
  Path path = *this;
  for (PathNode& node : path.nodes_) {
    node.T_odom_base = node.T_odom_base * T_base_other;
  }
  return path;
}

}  // namespace trigpoint::lio_mapper
