// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "iterated_update.hpp"
#include <Eigen/Eigenvalues>

namespace trigpoint::lio_mapper {

/// By so much a map bends while LIO makes it.
inline constexpr double kBend_rad = 0.01;
inline constexpr double kLeastShareUnbent = 0.5;

/// What a map that bends leaves of what a measurement says of the position, over odom's axes.
/// Planes hold the position across them; a map that bends turns them all by as much, and then they
/// seem to hold it along them too: in a tunnel, its length through its floor. Little as that is of
/// what they hold across, it is the same scan for scan, so that the length would soon pass for
/// known. Along each principal axis of the prior's position, of the information A, N = kBend^2
/// times that across is such. The rest, f = 1 - N / A, is taken as with noisy normals: the
/// information f^2 A with the gradient f g. By how much a map bends is not known, though: below
/// half the rest may be none as well, and what is left of the gradient, divided by it, would be any
/// distance. `covariance`: of the prior, m^2 in odom's axes.
inline Eigen::Matrix3d unbent_share(const ErrorMatrix& covariance,
                                    const PoseInformation& measured) {
  const Eigen::Matrix3d A = measured.information.topLeftCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(
      covariance.block<3, 3>(error::kPosition, error::kPosition));
  Eigen::Matrix3d unbent = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = axes.eigenvectors().col(i);
    const double along = axis.dot(A * axis);
    const double none = kBend_rad * kBend_rad * (A.trace() - along);
    const double share = 1.0 - none / (along + 1e-12);
    if (share >= kLeastShareUnbent) {
      unbent += share * axis * axis.transpose();
    }
  }
  return unbent;
}

/// Takes out of `measured` what is none.
inline void keep_unbent(const Eigen::Matrix3d& unbent, PoseInformation& measured) {
  measured.information.topRows<3>() = (unbent * measured.information.topRows<3>()).eval();
  measured.information.leftCols<3>() = (measured.information.leftCols<3>() * unbent).eval();
  measured.gradient.head<3>() = (unbent * measured.gradient.head<3>()).eval();
}

}  // namespace trigpoint::lio_mapper
