// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ekf15.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Below this the Euler rates are limited (pitch above 87 degrees).
constexpr double kLeastCosPitch = 0.05;

Matrix3d rotation_of(const Vector3d& roll_pitch_yaw_rad) {
  return from_roll_pitch_yaw(roll_pitch_yaw_rad).toRotationMatrix();
}

void symmetrise(Matrix15d& P) {
  P = (0.5 * (P + P.transpose())).eval();
}

/// Kalman update with the covariance in Joseph's form, standard form of the paper's (3)-(5): there
/// (2) and (5) are printed with the transposes on the wrong side.
template <int M>
void update(Ekf15& filter,
            const Eigen::Matrix<double, M, 1>& innovation,
            const Eigen::Matrix<double, M, 15>& H,
            const Eigen::Matrix<double, M, M>& R) {
  const Eigen::Matrix<double, 15, M> PHt = filter.P * H.transpose();
  const Eigen::Matrix<double, M, M> S = H * PHt + R;
  Eigen::Matrix<double, 15, M> K;
  if constexpr (M == 1) {
    K = PHt / S.value();
  } else {
    K = S.ldlt().solve(PHt.transpose()).transpose();
  }
  filter.x += K * innovation;
  for (int i = 0; i < 3; ++i) {
    filter.x(kAttitude + i) = wrap_angle(filter.x(kAttitude + i));
  }
  const Matrix15d left = Matrix15d::Identity() - K * H;
  filter.P = left * filter.P * left.transpose() + K * R * K.transpose();
  symmetrise(filter.P);
}

/// Rates of the noise that enters each state; it reaches the others through the model.
Vector15d noise_rates(const MotionNoise& noise, double dt_s) {
  Vector15d q = Vector15d::Zero();
  const auto square = [](double value) { return value * value; };
  q.segment<3>(kAttitude).setConstant(square(noise.attitude_rad_sqrts));
  q.segment<2>(kAttitude).array() += square(noise.tilt_rad_sqrts);
  q.segment<2>(kVelocity).setConstant(square(noise.velocity_mps_sqrts));
  q(kVelocity + 2) = square(noise.velocity_up_mps_sqrts);
  q.segment<3>(kRate).setConstant(square(noise.rate_radps_sqrts));
  // First-order Gauss-Markov, exact for the step: sigma^2 (1 - exp(-2 dt / tau)) ([2] 8.2.3).
  const double grown = -std::expm1(-2.0 * dt_s / noise.acceleration_tau_s);
  q.segment<3>(kAcceleration).setConstant(square(noise.acceleration_sigma_mps2) * grown / dt_s);
  return q;
}

void predict_step(Ekf15& filter, double dt_s, const MotionNoise& noise) {
  const Matrix15d F = propagation_jacobian(filter.x, dt_s, noise.acceleration_tau_s);
  const Vector15d q = noise_rates(noise, dt_s);
  // The integral of Phi q Phi^T over the step by Simpson's rule, exact where the integrand is a
  // cubic in time: unlike dt * q on the diagonal it does not depend on how the time is cut. The
  // trapezoid rule is not enough: of a random walk of the rates it makes the angle's variance q
  // dt^3 / 2 instead of q dt^3 / 3, and once a gyro sample has told the rate, q dt^3 / 4 instead of
  // q dt^3 / 12 are left.
  const Matrix15d half = propagation_jacobian(filter.x, 0.5 * dt_s, noise.acceleration_tau_s);
  Matrix15d Q = F * q.asDiagonal() * F.transpose();
  Q += 4.0 * (half * q.asDiagonal() * half.transpose());
  Q.diagonal() += q;
  filter.x = propagate(filter.x, dt_s, noise.acceleration_tau_s);
  filter.P = F * filter.P * F.transpose() + (dt_s / 6.0) * Q;
  symmetrise(filter.P);
}

}  // namespace

Matrix3d Ekf15::R_map_base() const {
  return rotation_of(x.segment<3>(kAttitude));
}

Matrix3d body_from_euler_rates(const Vector3d& roll_pitch_yaw_rad) {
  const double sr = std::sin(roll_pitch_yaw_rad.x());
  const double cr = std::cos(roll_pitch_yaw_rad.x());
  const double sp = std::sin(roll_pitch_yaw_rad.y());
  const double cp = std::cos(roll_pitch_yaw_rad.y());
  Matrix3d W;
  W << 1.0, 0.0, -sp,    //
      0.0, cr, sr * cp,  //
      0.0, -sr, cr * cp;
  return W;
}

Matrix3d euler_from_body_rates(const Vector3d& roll_pitch_yaw_rad) {
  const double sr = std::sin(roll_pitch_yaw_rad.x());
  const double cr = std::cos(roll_pitch_yaw_rad.x());
  const double sp = std::sin(roll_pitch_yaw_rad.y());
  const double cosine = std::cos(roll_pitch_yaw_rad.y());
  const double cp = std::copysign(std::max(std::abs(cosine), kLeastCosPitch), cosine);
  Matrix3d E;
  E << 1.0, sr * sp / cp, cr * sp / cp,  //
      0.0, cr, -sr,                      //
      0.0, sr / cp, cr / cp;
  return E;
}

Vector15d propagate(const Vector15d& x, double dt_s, double acceleration_tau_s) {
  const Vector3d rpy = x.segment<3>(kAttitude);
  const Vector3d v = x.segment<3>(kVelocity);
  const Vector3d w = x.segment<3>(kRate);
  const Vector3d a = x.segment<3>(kAcceleration);
  const Eigen::Quaterniond q = from_roll_pitch_yaw(rpy);
  const Vector3d manoeuvre = a - w.cross(v);  // change of the body velocity as the body sees it
  Vector15d next = x;
  next.segment<3>(kPosition) += q * (v * dt_s + 0.5 * dt_s * dt_s * a);
  next.segment<3>(kAttitude) = roll_pitch_yaw_of((q * so3_exp(w * dt_s)).normalized());
  next.segment<3>(kVelocity) += manoeuvre * dt_s;
  next.segment<3>(kAcceleration) += std::expm1(-dt_s / acceleration_tau_s) * manoeuvre;
  return next;
}

Matrix15d propagation_jacobian(const Vector15d& x, double dt_s, double acceleration_tau_s) {
  const Vector3d rpy = x.segment<3>(kAttitude);
  const Vector3d v = x.segment<3>(kVelocity);
  const Vector3d w = x.segment<3>(kRate);
  const Vector3d a = x.segment<3>(kAcceleration);
  const Eigen::Quaterniond q = from_roll_pitch_yaw(rpy);
  const Matrix3d R = q.toRotationMatrix();
  const Matrix3d W = body_from_euler_rates(rpy);
  const Eigen::Quaterniond turn = so3_exp(w * dt_s);
  const Matrix3d E_next = euler_from_body_rates(roll_pitch_yaw_of((q * turn).normalized()));
  const double decay = std::expm1(-dt_s / acceleration_tau_s);  // phi - 1

  Matrix15d F = Matrix15d::Identity();
  F.block<3, 3>(kPosition, kAttitude) = -R * hat(v * dt_s + 0.5 * dt_s * dt_s * a) * W;
  F.block<3, 3>(kPosition, kVelocity) = R * dt_s;
  F.block<3, 3>(kPosition, kAcceleration) = 0.5 * dt_s * dt_s * R;
  F.block<3, 3>(kAttitude, kAttitude) = E_next * turn.toRotationMatrix().transpose() * W;
  F.block<3, 3>(kAttitude, kRate) = E_next * so3_right_jacobian(w * dt_s) * dt_s;
  F.block<3, 3>(kVelocity, kVelocity) -= hat(w) * dt_s;
  F.block<3, 3>(kVelocity, kRate) = hat(v) * dt_s;
  F.block<3, 3>(kVelocity, kAcceleration) = Matrix3d::Identity() * dt_s;
  F.block<3, 3>(kAcceleration, kAcceleration) *= 1.0 + decay;
  F.block<3, 3>(kAcceleration, kVelocity) = -decay * hat(w);
  F.block<3, 3>(kAcceleration, kRate) = decay * hat(v);
  return F;
}

void predict(Ekf15& filter, double duration_s, double longest_step_s, const MotionNoise& noise) {
  if (!(duration_s > 0.0)) {
    return;
  }
  const int steps = std::max(1, static_cast<int>(std::ceil(duration_s / longest_step_s - 1e-9)));
  for (int i = 0; i < steps; ++i) {
    predict_step(filter, duration_s / steps, noise);
  }
}

Vector3d expected_specific_force(const Vector15d& x) {
  const Matrix3d R = rotation_of(x.segment<3>(kAttitude));
  return x.segment<3>(kAcceleration) + kGravity_mps2 * R.row(2).transpose();
}

Eigen::Matrix<double, 3, 15> specific_force_jacobian(const Vector15d& x) {
  const Vector3d rpy = x.segment<3>(kAttitude);
  const Vector3d up_base = rotation_of(rpy).row(2).transpose();
  Eigen::Matrix<double, 3, 15> H = Eigen::Matrix<double, 3, 15>::Zero();
  // d(R^T u) = hat(R^T u) d(theta), d(theta) about body axes.
  H.block<3, 3>(0, kAttitude) = kGravity_mps2 * hat(up_base) * body_from_euler_rates(rpy);
  H.block<3, 3>(0, kAcceleration).setIdentity();
  return H;
}

Vector3d expected_antenna(const Vector15d& x, const Vector3d& lever_base_m) {
  return x.segment<3>(kPosition) + rotation_of(x.segment<3>(kAttitude)) * lever_base_m;
}

Eigen::Matrix<double, 3, 15> antenna_jacobian(const Vector15d& x, const Vector3d& lever_base_m) {
  const Vector3d rpy = x.segment<3>(kAttitude);
  Eigen::Matrix<double, 3, 15> H = Eigen::Matrix<double, 3, 15>::Zero();
  H.block<3, 3>(0, kPosition).setIdentity();
  H.block<3, 3>(0, kAttitude) = -rotation_of(rpy) * hat(lever_base_m) * body_from_euler_rates(rpy);
  return H;
}

void update_imu(Ekf15& filter,
                const Vector3d& gyro_radps,
                const Vector3d& accel_mps2,
                double gyro_sigma_radps,
                double accel_sigma_mps2) {
  Eigen::Matrix<double, 6, 1> innovation;
  innovation << gyro_radps - filter.x.segment<3>(kRate),
      accel_mps2 - expected_specific_force(filter.x);
  Eigen::Matrix<double, 6, 15> H = Eigen::Matrix<double, 6, 15>::Zero();
  H.block<3, 3>(0, kRate).setIdentity();
  H.bottomRows<3>() = specific_force_jacobian(filter.x);
  Eigen::Matrix<double, 6, 1> variance;
  variance.head<3>().setConstant(gyro_sigma_radps * gyro_sigma_radps);
  variance.tail<3>().setConstant(accel_sigma_mps2 * accel_sigma_mps2);
  update<6>(filter, innovation, H, variance.asDiagonal());
}

void update_antenna(Ekf15& filter,
                    const Vector3d& position_map_m,
                    const Matrix3d& covariance_m2,
                    const Vector3d& lever_base_m) {
  const Vector3d innovation = position_map_m - expected_antenna(filter.x, lever_base_m);
  update<3>(filter, innovation, antenna_jacobian(filter.x, lever_base_m), covariance_m2);
}

void update_velocity(Ekf15& filter, const Vector3d& velocity_base_mps, const Vector3d& sigma_mps) {
  Eigen::Matrix<double, 3, 15> H = Eigen::Matrix<double, 3, 15>::Zero();
  H.block<3, 3>(0, kVelocity).setIdentity();
  const Vector3d innovation = velocity_base_mps - filter.x.segment<3>(kVelocity);
  update<3>(filter, innovation, H, sigma_mps.cwiseAbs2().asDiagonal());
}

Vector3d point_velocity(const Vector15d& x, const Vector3d& point_base_m) {
  return x.segment<3>(kVelocity) + x.segment<3>(kRate).cross(point_base_m);
}

Eigen::Matrix<double, 3, 15> point_velocity_jacobian(const Vector3d& point_base_m) {
  Eigen::Matrix<double, 3, 15> H = Eigen::Matrix<double, 3, 15>::Zero();
  H.block<3, 3>(0, kVelocity).setIdentity();
  H.block<3, 3>(0, kRate) = -hat(point_base_m);
  return H;
}

void update_point_velocity(Ekf15& filter,
                           const Vector3d& velocity_base_mps,
                           const Matrix3d& covariance_m2ps2,
                           const Vector3d& point_base_m) {
  const Vector3d innovation = velocity_base_mps - point_velocity(filter.x, point_base_m);
  update<3>(filter, innovation, point_velocity_jacobian(point_base_m), covariance_m2ps2);
}

void update_yaw(Ekf15& filter, double yaw_rad, double sigma_rad) {
  Eigen::Matrix<double, 1, 15> H = Eigen::Matrix<double, 1, 15>::Zero();
  H(kAttitude + 2) = 1.0;
  const Eigen::Matrix<double, 1, 1> innovation(wrap_angle(yaw_rad - filter.x(kAttitude + 2)));
  update<1>(filter, innovation, H, Eigen::Matrix<double, 1, 1>(sigma_rad * sigma_rad));
}

void reset_block(Ekf15& filter, int first, const Matrix3d& covariance) {
  filter.P.middleRows<3>(first).setZero();
  filter.P.middleCols<3>(first).setZero();
  filter.P.block<3, 3>(first, first) = covariance;
}

void change_frame(Ekf15& filter, const Matrix3d& R_new_old, const Vector3d& t_new_old) {
  const Vector3d rpy = filter.x.segment<3>(kAttitude);
  const Eigen::Quaterniond q(R_new_old);
  const Vector3d rpy_new = roll_pitch_yaw_of((q * from_roll_pitch_yaw(rpy)).normalized());
  Matrix15d J = Matrix15d::Identity();
  J.block<3, 3>(kPosition, kPosition) = R_new_old;
  // A rotation about body axes is the same in both frames.
  J.block<3, 3>(kAttitude, kAttitude) = euler_from_body_rates(rpy_new) * body_from_euler_rates(rpy);
  filter.x.segment<3>(kPosition) = R_new_old * filter.x.segment<3>(kPosition) + t_new_old;
  filter.x.segment<3>(kAttitude) = rpy_new;
  filter.P = J * filter.P * J.transpose();
  symmetrise(filter.P);
}

}  // namespace trigpoint::gps_odometry
