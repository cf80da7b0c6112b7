// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a covariance must stay, whatever happens to it (research/gps E).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <cmath>

namespace trigpoint::gps_odometry {

/// No position is less certain: beyond it nothing would be learnt and digits would be lost.
inline constexpr double kLargestPositionSigma_m = 1e4;

/// Scales the first three errors (position) down to the largest sigma; stays positive.
template <int N>
void bound_position(Eigen::Matrix<double, N, N>& P) {
  for (int i = 0; i < 3; ++i) {
    if (P(i, i) > kLargestPositionSigma_m * kLargestPositionSigma_m) {
      const double factor = kLargestPositionSigma_m / std::sqrt(P(i, i));
      P.row(i) *= factor;
      P.col(i) *= factor;
    }
  }
}

/// Positive to the digits that a Kalman filter keeps: of the correlations, to 1e-6.
template <int N>
bool is_positive_covariance(const Eigen::Matrix<double, N, N>& P) {
  constexpr double kSlack = 1e-6;
  Eigen::Matrix<double, N, 1> scale = P.diagonal();
  if (!P.allFinite() || scale.minCoeff() < 0.0) {
    return false;
  }
  scale = scale.cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  Eigen::Matrix<double, N, N> correlation = scale.asDiagonal() * P * scale.asDiagonal();
  correlation.diagonal().array() += kSlack;
  return correlation.llt().info() == Eigen::Success;
}

}  // namespace trigpoint::gps_odometry
