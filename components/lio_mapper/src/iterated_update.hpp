// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The iterated update of the error-state Kalman filter.
// References: [1] W. Xu, F. Zhang, "FAST-LIO: A fast, robust LiDAR-inertial odometry package by
// tightly-coupled iterated Kalman filter", RA-L 2021, eq. 16-20. [2] W. Xu et al., "FAST-LIO2",
// T-RO 2022, eq. 10-15.
#pragma once

#include "state.hpp"
#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <functional>

namespace trigpoint::lio_mapper {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// What measurements say around one state: the normal equations of their residuals r with Jacobian
/// H over the error's first six columns, the pose.
struct PoseInformation {
  Matrix6d information{Matrix6d::Zero()};  ///< H^T R^-1 H
  Vector6d gradient{Vector6d::Zero()};     ///< H^T R^-1 r
  /// What the noise of the planes' normals adds to the position's information though it tells
  /// nothing; already taken out when the sum is complete.
  Eigen::Matrix3d noise{Eigen::Matrix3d::Zero()};
  /// Sums of the residuals' weights, and of the variances of the map's points across their planes
  /// times those.
  double weight_per_m2{0.0};
  double weighted_thickness2{0.0};
  std::size_t count{0};           ///< residuals in it
  double weighted_variance{0.0};  ///< sum of their variances times their weights
};

struct IterationLimits {
  std::int64_t max_iterations{5};
  double converged_position_m{1e-3};
  double converged_rotation_rad{1e-4};
  std::size_t min_count{50};
};

struct UpdateResult {
  bool used{false};  ///< false: too few residuals, the prior is the result
  bool converged{false};
  int iterations{0};
  std::size_t count{0};
  State state;
  ErrorMatrix covariance;
  /// Error after over error before: (I - K H) J^-1.
  ErrorMatrix transition{ErrorMatrix::Identity()};
  /// Share of the prior variance that was removed: x y z of odom, then roll pitch yaw about odom's
  /// axes.
  std::array<double, 6> observability{};
  /// What the residuals alone said of the pose, at the last linearisation, and where that was.
  PoseInformation measured;
  Pose measured_at;
};

/// Iterates x <- x [+] (-K r - (I - K H) J^-1 (x [-] prior)), [1] eq. 18, with the gain in the form
/// K = (H^T R^-1 H + P^-1)^-1 H^T R^-1 of [1] eq. 20, here as
/// K R-weighted = P_{:,6} (I + A P_66)^-1 with A = H^T R^-1 H: the matrix inversion lemma on the
/// six columns that H has, so that only a system of that size is solved and P is never inverted.
UpdateResult iterated_update(const State& prior,
                             const ErrorMatrix& covariance,
                             const std::function<PoseInformation(const Pose&)>& linearise,
                             const IterationLimits& limits);

/// The covariance of who is also told of the pose what `information` knows (axes of the error).
ErrorMatrix conditioned(const ErrorMatrix& covariance, const Matrix6d& information);

}  // namespace trigpoint::lio_mapper
