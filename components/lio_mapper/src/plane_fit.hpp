// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <optional>

namespace trigpoint::lio_mapper {

/// Sums of points, all of equal weight, from which their mean and covariance follow.
struct Moments {
  int count{0};
  Eigen::Vector3d sum{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d outer{Eigen::Matrix3d::Zero()};  ///< sum of p p^T

  void add(const Eigen::Vector3d& point);
  Moments& operator+=(const Moments& other);
};

struct PlaneFit {
  Eigen::Vector3d normal{Eigen::Vector3d::UnitZ()};
  Eigen::Vector3d centroid{Eigen::Vector3d::Zero()};
  Eigen::Vector3d eigenvalues{Eigen::Vector3d::Zero()};  ///< ascending, m^2

  /// Smallest over largest eigenvalue: 0 for a plane.
  double flatness() const { return eigenvalues[0] / eigenvalues[2]; }

  /// Middle over largest: 0 for a line.
  double linearity() const { return eigenvalues[1] / eigenvalues[2]; }
};

/// Principal axes of the points, by eigen-decomposition of their covariance (divided by count). The
/// normal is the axis of least spread, its sign such that the largest component is positive.
/// Nothing for fewer than 3 points or points that all coincide.
std::optional<PlaneFit> fit_plane(const Moments& moments);

}  // namespace trigpoint::lio_mapper
