// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Strict mode of ekf15: the published Moore-Stouch filter with its defects, as a reference to
// compare with. Nothing here is validated: what may be used is decided elsewhere (fix_checks,
// imu_checks), and ekf15.hpp is the filter to drive with.
// References: [1] T. Moore, D. Stouch, "A generalized extended Kalman filter implementation for the
// Robot Operating System", IAS-13, 2014. [2] Y. Bar-Shalom, X. Li, T. Kirubarajan, "Estimation with
// applications to tracking and navigation", 2001, eq. 5.2.3-18 (Joseph form).
//
// The paper that this project implements prints [1]'s equations with mistakes; the standard forms
// are used here, as the published filter does itself:
//   (2) printed Q + F^T P F                      used  F P F^T + dt Q (Q is a rate per second)
//   (3) printed H^T P (R + H^T P H)^-1           used  P H^T (H P H^T + R)^-1
//   (5) printed K^T R K + (I-KH)^T P (I-KH)      used  K R K^T + (I-KH) P (I-KH)^T
//   (7) printed as T^-1, is T itself (its translation is +utm_0), and its element (1,3) has
//       s.theta s.psi where s.phi s.psi belongs. It places GPS fixes and is no part of this filter;
//       fixes are placed by components/geodesy.
#pragma once

#include "ekf15.hpp"

#include <bitset>
#include <optional>

namespace trigpoint::gps_odometry {

/// Bit i: state i (order of StateIndex) is measured.
using MeasuredStates = std::bitset<15>;

/// Diagonal of the published default of Q, state's unit squared per second.
Vector15d published_process_noise();

/// Variance of every state before the first measurement.
inline constexpr double kPublishedInitialVariance = 1e-9;

/// x' = f(x): position in the world frame, velocity and acceleration in base_link, no -w x v in the
/// velocity. Angles are not wrapped. Infinite at pitch 90 degrees.
Vector15d moore_stouch_model(const Vector15d& x, double dt_s);
Matrix15d moore_stouch_jacobian(const Vector15d& x, double dt_s);

enum class StrictOutcome { kInitialised, kFused, kRefusedByGate, kNothingMeasured };

struct MooreStouch {
  Vector15d x{Vector15d::Zero()};
  Matrix15d P{kPublishedInitialVariance * Matrix15d::Identity()};
  Vector15d process_noise_per_s{published_process_noise()};
  /// Mahalanobis distance from which a whole measurement is refused, whatever the number of its
  /// states; off by default, as published.
  std::optional<double> gate_sigmas;
  /// False: the next correct() sets the measured states instead of fusing them.
  bool initialised{false};

  /// P' = J P J^T + dt Q, Q on the diagonal only and not carried through J: the covariance depends
  /// on how a duration is cut.
  void predict(double dt_s);

  /// Measures the states of `measured` directly, with these entries of z and R. Values that are not
  /// finite are left out; a negative variance is taken as its absolute value, and 1e-9 is the
  /// least. The first measurement is copied as it is, without these checks.
  StrictOutcome correct(const Vector15d& z, const Matrix15d& R, const MeasuredStates& measured);
};

}  // namespace trigpoint::gps_odometry
