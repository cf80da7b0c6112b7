// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "eskf18.hpp"

#include "trigpoint/base/so3.hpp"

#include "gravity.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using namespace ins;

const Vector3d kGravity_map_mps2(0.0, 0.0, -kGravity_mps2);

void symmetrise(Matrix18d& P) {
  P = (0.5 * (P + P.transpose())).eval();
}

double square(double value) {
  return value * value;
}

template <int M>
void update(Eskf18& filter,
            const Eigen::Matrix<double, M, 1>& innovation,
            const Eigen::Matrix<double, M, 18>& H,
            const Eigen::Matrix<double, M, M>& R) {
  const Eigen::Matrix<double, 18, M> PHt = filter.P * H.transpose();
  const Eigen::Matrix<double, M, M> S = H * PHt + R;
  const Eigen::Matrix<double, M, M> S_inverse =
      S.ldlt().solve(Eigen::Matrix<double, M, M>::Identity());
  const Eigen::Matrix<double, 18, M> K = PHt * S_inverse;
  const Matrix18d left = Matrix18d::Identity() - K * H;
  filter.P = left * filter.P * left.transpose() + K * R * K.transpose();
  const Vector18d error = K * innovation;
  filter = with_error(filter, error);
  // What is left of the rotation error is about the turned axes: Exp(e) = Exp(d) Exp(rest), rest =
  // Jr(d) (e - d) to first order ([1] 6.3, there to half an angle).
  const Matrix3d G = so3_right_jacobian(error.segment<3>(kRotation));
  filter.P.middleRows<3>(kRotation) = (G * filter.P.middleRows<3>(kRotation)).eval();
  filter.P.middleCols<3>(kRotation) = (filter.P.middleCols<3>(kRotation) * G.transpose()).eval();
  symmetrise(filter.P);
}

/// Rates of the noise that enters each error; it reaches the others through the model.
Vector18d noise_rates(const InsNoise& noise) {
  Vector18d q = Vector18d::Zero();
  q.segment<3>(kVelocity).setConstant(square(noise.accel_mps2_sqrthz));
  q.segment<3>(kRotation).setConstant(square(noise.gyro_radps_sqrthz));
  q.segment<3>(kGyroBias).setConstant(square(noise.gyro_bias_radps_sqrts));
  q.segment<3>(kAccelBias).setConstant(square(noise.accel_bias_mps2_sqrts));
  return q;
}

void predict_step(Eskf18& filter, const ImuMean& imu, double dt_s, const InsNoise& noise) {
  const Matrix18d F = transition(filter, imu, dt_s, noise.fix_error_tau_s);
  const Vector18d q = noise_rates(noise);
  // The integral of Phi q Phi^T over the step by the trapezoid rule: P' = F (P + q dt/2) F^T +
  // q dt/2, the same however the time is cut.
  Matrix18d P = filter.P;
  P.diagonal() += 0.5 * dt_s * q;
  const Matrix18d FP = F * P;
  filter.P.noalias() = FP * F.transpose();
  filter.P.diagonal() += 0.5 * dt_s * q;
  // First-order Gauss-Markov, exact for any step ([3] 8.2.3).
  filter.P.diagonal().segment<3>(kFixError) +=
      -std::expm1(-2.0 * dt_s / noise.fix_error_tau_s) * noise.fix_error_sigma_m.cwiseAbs2();
  symmetrise(filter.P);
  filter = propagate(filter, imu, dt_s, noise.fix_error_tau_s);
}

}  // namespace

bool Eskf18::is_finite() const {
  return p_map_m.allFinite() && v_map_mps.allFinite() && q_map_base.coeffs().allFinite() &&
         gyro_bias_radps.allFinite() && accel_bias_mps2.allFinite() &&
         fix_error_map_m.allFinite() && P.allFinite() && P.diagonal().minCoeff() >= 0.0;
}

Eskf18 with_error(const Eskf18& filter, const Vector18d& error) {
  Eskf18 moved = filter;
  moved.p_map_m += error.segment<3>(kPosition);
  moved.v_map_mps += error.segment<3>(kVelocity);
  moved.q_map_base = (filter.q_map_base * so3_exp(error.segment<3>(kRotation))).normalized();
  moved.gyro_bias_radps += error.segment<3>(kGyroBias);
  moved.accel_bias_mps2 += error.segment<3>(kAccelBias);
  moved.fix_error_map_m += error.segment<3>(kFixError);
  return moved;
}

Eskf18 propagate(const Eskf18& filter, const ImuMean& imu, double dt_s, double fix_error_tau_s) {
  const Vector3d w = imu.gyro_radps - filter.gyro_bias_radps;
  const Vector3d f = imu.accel_mps2 - filter.accel_bias_mps2;
  const Vector3d a_map = filter.q_map_base * (so3_exp(0.5 * dt_s * w) * f) + kGravity_map_mps2;
  Eskf18 next = filter;
  next.p_map_m += filter.v_map_mps * dt_s + 0.5 * dt_s * dt_s * a_map;
  next.v_map_mps += a_map * dt_s;
  next.q_map_base = (filter.q_map_base * so3_exp(w * dt_s)).normalized();
  next.fix_error_map_m *= std::exp(-dt_s / fix_error_tau_s);
  return next;
}

Matrix18d transition(const Eskf18& filter,
                     const ImuMean& imu,
                     double dt_s,
                     double fix_error_tau_s) {
  const Vector3d w = imu.gyro_radps - filter.gyro_bias_radps;
  const Vector3d f = imu.accel_mps2 - filter.accel_bias_mps2;
  const Matrix3d half_turn = so3_exp(0.5 * dt_s * w).toRotationMatrix();
  const Matrix3d R_middle = filter.R_map_base() * half_turn;
  // d(R_middle f) by the rotation error and by the gyro's bias (through the half turn).
  const Matrix3d by_rotation = -R_middle * hat(f) * half_turn.transpose();
  const Matrix3d by_gyro_bias = 0.5 * dt_s * R_middle * hat(f) * so3_right_jacobian(0.5 * dt_s * w);
  const double half_square = 0.5 * dt_s * dt_s;

  Matrix18d F = Matrix18d::Identity();
  F.block<3, 3>(kPosition, kVelocity) = dt_s * Matrix3d::Identity();
  F.block<3, 3>(kPosition, kRotation) = half_square * by_rotation;
  F.block<3, 3>(kPosition, kGyroBias) = half_square * by_gyro_bias;
  F.block<3, 3>(kPosition, kAccelBias) = -half_square * R_middle;
  F.block<3, 3>(kVelocity, kRotation) = dt_s * by_rotation;
  F.block<3, 3>(kVelocity, kGyroBias) = dt_s * by_gyro_bias;
  F.block<3, 3>(kVelocity, kAccelBias) = -dt_s * R_middle;
  F.block<3, 3>(kRotation, kRotation) = so3_exp(-dt_s * w).toRotationMatrix();
  F.block<3, 3>(kRotation, kGyroBias) = -dt_s * so3_right_jacobian(dt_s * w);
  F.block<3, 3>(kFixError, kFixError) *= std::exp(-dt_s / fix_error_tau_s);
  return F;
}

void predict(Eskf18& filter,
             const ImuMean& imu,
             double duration_s,
             double longest_step_s,
             const InsNoise& noise) {
  if (!(duration_s > 0.0)) {
    return;
  }
  const int steps = std::max(1, static_cast<int>(std::ceil(duration_s / longest_step_s - 1e-9)));
  for (int i = 0; i < steps; ++i) {
    predict_step(filter, imu, duration_s / steps, noise);
  }
}

// ---- what sensors should see --------------------------------------------------------------------

Vector3d antenna(const Eskf18& filter, const Vector3d& lever_base_m) {
  return filter.p_map_m + filter.q_map_base * lever_base_m;
}

Jacobian3 antenna_jacobian(const Eskf18& filter, const Vector3d& lever_base_m) {
  Jacobian3 H = Jacobian3::Zero();
  H.block<3, 3>(0, kPosition).setIdentity();
  H.block<3, 3>(0, kRotation) = -filter.R_map_base() * hat(lever_base_m);
  return H;
}

Vector3d expected_fix(const Eskf18& filter, const Vector3d& lever_base_m) {
  return antenna(filter, lever_base_m) + filter.fix_error_map_m;
}

Jacobian3 fix_jacobian(const Eskf18& filter, const Vector3d& lever_base_m) {
  Jacobian3 H = antenna_jacobian(filter, lever_base_m);
  H.block<3, 3>(0, kFixError).setIdentity();
  return H;
}

Vector3d body_velocity(const Eskf18& filter,
                       const Vector3d& point_base_m,
                       const Vector3d& gyro_radps) {
  return filter.q_map_base.conjugate() * filter.v_map_mps +
         (gyro_radps - filter.gyro_bias_radps).cross(point_base_m);
}

Jacobian3 body_velocity_jacobian(const Eskf18& filter, const Vector3d& point_base_m) {
  const Matrix3d R_base_map = filter.R_map_base().transpose();
  Jacobian3 H = Jacobian3::Zero();
  H.block<3, 3>(0, kVelocity) = R_base_map;
  H.block<3, 3>(0, kRotation) = hat(R_base_map * filter.v_map_mps);
  H.block<3, 3>(0, kGyroBias) = hat(point_base_m);
  return H;
}

Vector3d force_at_rest(const Eskf18& filter) {
  return filter.q_map_base.conjugate() * -kGravity_map_mps2 + filter.accel_bias_mps2;
}

Jacobian3 force_at_rest_jacobian(const Eskf18& filter) {
  Jacobian3 H = Jacobian3::Zero();
  H.block<3, 3>(0, kRotation) = hat(filter.q_map_base.conjugate() * -kGravity_map_mps2);
  H.block<3, 3>(0, kAccelBias).setIdentity();
  return H;
}

double yaw(const Eskf18& filter) {
  return yaw_of(filter.q_map_base);
}

Jacobian1 yaw_jacobian(const Eskf18& filter) {
  // yaw = atan2(r10, r00); the first column of R Exp(e) is that of R plus R (e x e1) =
  // e3 times the second column less e2 times the third.
  const Matrix3d R = filter.R_map_base();
  const double level = std::max(square(R(0, 0)) + square(R(1, 0)), 1e-6);
  Jacobian1 H = Jacobian1::Zero();
  H(kRotation + 1) = (R(1, 0) * R(0, 2) - R(0, 0) * R(1, 2)) / level;
  H(kRotation + 2) = (R(0, 0) * R(1, 1) - R(1, 0) * R(0, 1)) / level;
  return H;
}

// ---- updates ------------------------------------------------------------------------------------

void update_fix(Eskf18& filter,
                const Vector3d& antenna_map_m,
                const Matrix3d& white_covariance_m2,
                const Vector3d& lever_base_m) {
  const Vector3d innovation = antenna_map_m - expected_fix(filter, lever_base_m);
  update<3>(filter, innovation, fix_jacobian(filter, lever_base_m), white_covariance_m2);
}

void update_body_velocity(Eskf18& filter,
                          const Vector3d& velocity_base_mps,
                          const Matrix3d& covariance_m2ps2,
                          const Vector3d& point_base_m,
                          const Vector3d& gyro_radps) {
  const Vector3d innovation = velocity_base_mps - body_velocity(filter, point_base_m, gyro_radps);
  update<3>(filter, innovation, body_velocity_jacobian(filter, point_base_m), covariance_m2ps2);
}

void update_no_side_slip(Eskf18& filter,
                         double sigma_mps,
                         const Vector3d& point_base_m,
                         const Vector3d& gyro_radps) {
  const Eigen::Vector2d innovation = -body_velocity(filter, point_base_m, gyro_radps).tail<2>();
  const Eigen::Matrix<double, 2, 18> H =
      body_velocity_jacobian(filter, point_base_m).bottomRows<2>();
  update<2>(filter, innovation, H, square(sigma_mps) * Eigen::Matrix2d::Identity());
}

void update_at_rest(Eskf18& filter,
                    double velocity_sigma_mps,
                    const Vector3d& mean_gyro_radps,
                    double gyro_sigma_radps) {
  Eigen::Matrix<double, 6, 1> innovation;
  innovation << -filter.v_map_mps, mean_gyro_radps - filter.gyro_bias_radps;
  Eigen::Matrix<double, 6, 18> H = Eigen::Matrix<double, 6, 18>::Zero();
  H.block<3, 3>(0, kVelocity).setIdentity();
  H.block<3, 3>(3, kGyroBias).setIdentity();
  Eigen::Matrix<double, 6, 1> variance;
  variance.head<3>().setConstant(square(velocity_sigma_mps));
  variance.tail<3>().setConstant(square(gyro_sigma_radps));
  update<6>(filter, innovation, H, variance.asDiagonal());
}

void update_level(Eskf18& filter, const Vector3d& accel_mps2, double sigma_mps2) {
  const Vector3d innovation = accel_mps2 - force_at_rest(filter);
  update<3>(filter,
            innovation,
            force_at_rest_jacobian(filter),
            square(sigma_mps2) * Matrix3d::Identity());
}

void update_yaw(Eskf18& filter, double yaw_rad, double sigma_rad) {
  const Eigen::Matrix<double, 1, 1> innovation(wrap_angle(yaw_rad - yaw(filter)));
  update<1>(
      filter, innovation, yaw_jacobian(filter), Eigen::Matrix<double, 1, 1>(square(sigma_rad)));
}

// ---- decisions of others ------------------------------------------------------------------------

void reset_block(Eskf18& filter, int first, const Matrix3d& covariance) {
  filter.P.middleRows<3>(first).setZero();
  filter.P.middleCols<3>(first).setZero();
  filter.P.block<3, 3>(first, first) = covariance;
}

void reset_axis(Eskf18& filter, int index, double variance) {
  filter.P.row(index).setZero();
  filter.P.col(index).setZero();
  filter.P(index, index) = variance;
}

void set_heading(Eskf18& filter, double turn_rad, double sigma_rad) {
  filter.q_map_base = (from_yaw(turn_rad) * filter.q_map_base).normalized();
  // Rotation errors about the axes of map, there the heading stands alone.
  Matrix18d T = Matrix18d::Identity();
  T.block<3, 3>(kRotation, kRotation) = filter.R_map_base();
  filter.P = (T * filter.P * T.transpose()).eval();
  reset_axis(filter, kRotation + 2, square(sigma_rad));
  filter.P = (T.transpose() * filter.P * T).eval();
  symmetrise(filter.P);
}

void doubt_rotation(Eskf18& filter, const Vector3d& sigma_map_rad) {
  const Matrix3d R = filter.R_map_base();
  filter.P.block<3, 3>(kRotation, kRotation) +=
      R.transpose() * sigma_map_rad.cwiseAbs2().asDiagonal() * R;
  symmetrise(filter.P);
}

void change_frame(Eskf18& filter, const Matrix3d& R_new_old, const Vector3d& t_new_old) {
  filter.p_map_m = R_new_old * filter.p_map_m + t_new_old;
  filter.v_map_mps = R_new_old * filter.v_map_mps;
  filter.q_map_base = (Quaterniond(R_new_old) * filter.q_map_base).normalized();
  filter.fix_error_map_m = R_new_old * filter.fix_error_map_m;
  Matrix18d T = Matrix18d::Identity();
  for (const int first : {kPosition, kVelocity, kFixError}) {
    T.block<3, 3>(first, first) = R_new_old;
  }
  filter.P = (T * filter.P * T.transpose()).eval();
  symmetrise(filter.P);
}

}  // namespace trigpoint::gps_odometry
