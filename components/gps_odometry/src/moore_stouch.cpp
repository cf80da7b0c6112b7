// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "moore_stouch.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <vector>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kLeastVariance = 1e-9;

/// Rates of roll, pitch, yaw from body rates w, and what their derivatives share.
struct EulerRates {
  EulerRates(const Vector3d& roll_pitch_yaw_rad, const Vector3d& w)
      : sin_roll(std::sin(roll_pitch_yaw_rad.x())),
        cos_roll(std::cos(roll_pitch_yaw_rad.x())),
        tan_pitch(std::tan(roll_pitch_yaw_rad.y())),
        cos_pitch(std::cos(roll_pitch_yaw_rad.y())),
        about_up(sin_roll * w.y() + cos_roll * w.z()),
        about_side(cos_roll * w.y() - sin_roll * w.z()),
        w_roll(w.x()) {}

  Vector3d rates() const {
    return {w_roll + tan_pitch * about_up, about_side, about_up / cos_pitch};
  }

  /// d(rates) / d(roll, pitch, yaw): d(about_up)/d(roll) = about_side, d(about_side)/d(roll) =
  /// -about_up.
  Matrix3d by_attitude() const {
    Matrix3d D;
    D << tan_pitch * about_side, about_up / (cos_pitch * cos_pitch), 0.0,  //
        -about_up, 0.0, 0.0,                                               //
        about_side / cos_pitch, about_up * tan_pitch / cos_pitch, 0.0;
    return D;
  }

  /// d(rates) / dw
  Matrix3d by_body_rates() const {
    Matrix3d E;
    E << 1.0, sin_roll * tan_pitch, cos_roll * tan_pitch,  //
        0.0, cos_roll, -sin_roll,                          //
        0.0, sin_roll / cos_pitch, cos_roll / cos_pitch;
    return E;
  }

  double sin_roll, cos_roll, tan_pitch, cos_pitch;
  double about_up, about_side;  ///< rates of yaw and pitch axes at pitch zero, rad/s
  double w_roll;
};

Vector3d displacement_base(const Vector15d& x, double dt_s) {
  return x.segment<3>(kVelocity) * dt_s + 0.5 * dt_s * dt_s * x.segment<3>(kAcceleration);
}

void wrap_attitude(Vector15d& x) {
  for (int i = kAttitude; i < kAttitude + 3; ++i) {
    x(i) = wrap_angle(x(i));
  }
}

std::vector<int> usable_states(const Vector15d& z, const MeasuredStates& measured) {
  std::vector<int> states;
  for (int i = 0; i < 15; ++i) {
    if (measured[static_cast<std::size_t>(i)] && std::isfinite(z(i))) {
      states.push_back(i);
    }
  }
  return states;
}

/// z - x of the measured states, angles the short way round.
VectorXd innovation_of(const Vector15d& z, const Vector15d& x, const std::vector<int>& states) {
  VectorXd innovation = z(states) - x(states);
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (states[i] >= kAttitude && states[i] < kAttitude + 3) {
      auto& angle_rad = innovation(static_cast<Eigen::Index>(i));
      angle_rad = wrap_angle(angle_rad);
    }
  }
  return innovation;
}

MatrixXd sanitised(const Matrix15d& R, const std::vector<int>& states) {
  MatrixXd used = R(states, states);
  used.diagonal() = used.diagonal().unaryExpr([](double variance) {
    // Not std::max: a NaN stays what it is, as published.
    return std::abs(variance) < kLeastVariance ? kLeastVariance : std::abs(variance);
  });
  return used;
}

void initialise(MooreStouch& filter,
                const Vector15d& z,
                const Matrix15d& R,
                const MeasuredStates& measured) {
  // By element: with index lists on both sides g++ 12 warns falsely (-Wfree-nonheap-object).
  for (int i = 0; i < 15; ++i) {
    if (!measured[static_cast<std::size_t>(i)]) {
      continue;
    }
    filter.x(i) = z(i);
    for (int j = 0; j < 15; ++j) {
      if (measured[static_cast<std::size_t>(j)]) {
        filter.P(i, j) = R(i, j);
      }
    }
  }
  filter.initialised = true;
}

}  // namespace

Vector15d published_process_noise() {
  Vector15d q;
  q << 0.05, 0.05, 0.06,   // position, m^2/s
      0.03, 0.03, 0.06,    // attitude, rad^2/s
      0.025, 0.025, 0.04,  // velocity, (m/s)^2/s
      0.01, 0.01, 0.02,    // rates, (rad/s)^2/s
      0.01, 0.01, 0.015;   // acceleration, (m/s^2)^2/s
  return q;
}

Vector15d moore_stouch_model(const Vector15d& x, double dt_s) {
  const Vector3d rpy = x.segment<3>(kAttitude);
  Vector15d next = x;
  next.segment<3>(kPosition) += from_roll_pitch_yaw(rpy) * displacement_base(x, dt_s);
  next.segment<3>(kAttitude) += dt_s * EulerRates(rpy, x.segment<3>(kRate)).rates();
  next.segment<3>(kVelocity) += dt_s * x.segment<3>(kAcceleration);
  return next;
}

Matrix15d moore_stouch_jacobian(const Vector15d& x, double dt_s) {
  const Vector3d rpy = x.segment<3>(kAttitude);
  const Matrix3d R = from_roll_pitch_yaw(rpy).toRotationMatrix();
  const EulerRates euler(rpy, x.segment<3>(kRate));
  Matrix15d J = Matrix15d::Identity();
  // d(R u) = R d(theta) x u with d(theta) = W d(rpy) about body axes.
  J.block<3, 3>(kPosition, kAttitude) =
      -R * hat(displacement_base(x, dt_s)) * body_from_euler_rates(rpy);
  J.block<3, 3>(kPosition, kVelocity) = dt_s * R;
  J.block<3, 3>(kPosition, kAcceleration) = 0.5 * dt_s * dt_s * R;
  J.block<3, 3>(kAttitude, kAttitude) += dt_s * euler.by_attitude();
  J.block<3, 3>(kAttitude, kRate) = dt_s * euler.by_body_rates();
  J.block<3, 3>(kVelocity, kAcceleration) = dt_s * Matrix3d::Identity();
  return J;
}

void MooreStouch::predict(double dt_s) {
  const Matrix15d J = moore_stouch_jacobian(x, dt_s);
  x = moore_stouch_model(x, dt_s);
  wrap_attitude(x);
  P = (J * P * J.transpose()).eval();
  P.diagonal() += dt_s * process_noise_per_s;
}

StrictOutcome MooreStouch::correct(const Vector15d& z,
                                   const Matrix15d& R,
                                   const MeasuredStates& measured) {
  if (!initialised) {
    initialise(*this, z, R, measured);
    return StrictOutcome::kInitialised;
  }
  const std::vector<int> states = usable_states(z, measured);
  if (states.empty()) {
    return StrictOutcome::kNothingMeasured;
  }
  const MatrixXd R_used = sanitised(R, states);
  const VectorXd innovation = innovation_of(z, x, states);
  // H is rows of the identity, so H P H^T and P H^T are rows and columns of P.
  const MatrixXd S_inverse = (P(states, states) + R_used).inverse();
  const double distance_squared = innovation.dot(S_inverse * innovation);
  if (gate_sigmas && distance_squared >= *gate_sigmas * *gate_sigmas) {
    return StrictOutcome::kRefusedByGate;
  }
  const MatrixXd K = P(Eigen::all, states) * S_inverse;
  x += K * innovation;
  wrap_attitude(x);
  Matrix15d left = Matrix15d::Identity();  // I - K H
  left(Eigen::all, states) -= K;
  P = (left * P * left.transpose() + K * R_used * K.transpose()).eval();
  return StrictOutcome::kFused;
}

}  // namespace trigpoint::gps_odometry
