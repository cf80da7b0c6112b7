// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <span>

namespace trigpoint::lio_mapper {

/// Sums of points, all of equal weight, from which their mean and covariance follow.
struct Moments {
  int count{0};
  Eigen::Array3d sum{Eigen::Array3d::Zero()};
  Eigen::Array3d squares{Eigen::Array3d::Zero()};   ///< sums of xx, yy, zz
  Eigen::Array3d products{Eigen::Array3d::Zero()};  ///< sums of xy, yz, zx

  // Inline: the innermost loop of fitting.
  void add(const Eigen::Vector3d& p) {
    ++count;
    sum += p.array();
    squares += p.array() * p.array();
    products += p.array() * Eigen::Array3d(p.y(), p.z(), p.x());
  }

  Moments& operator+=(const Moments& other) {
    count += other.count;
    sum += other.sum;
    squares += other.squares;
    products += other.products;
    return *this;
  }

  /// Sum of p p^T.
  Eigen::Matrix3d outer() const {
    Eigen::Matrix3d m;
    m << squares[0], products[0], products[2], products[0], squares[1], products[1], products[2],
        products[1], squares[2];
    return m;
  }
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

/// (5 mm)^2: no LiDAR knows a surface better, however well its points agree.
inline constexpr double kThicknessFloor2_m2 = 2.5e-5;

/// FAST-LIO2's plane of few neighbouring points [W. Xu et al., FAST-LIO2, T-RO 2022, section V]:
/// nothing when they lie on a line or one of them is farther than `max_distance_m` from it.
std::optional<PlaneFit> fit_neighbours(std::span<const Eigen::Vector3d> points,
                                       double max_distance_m);

/// Variance of the normal about the axis of the larger tilt: `count` points of variance
/// `thickness2_m2` across the plane on a lever whose mean square is the middle eigenvalue.
inline double tilt2_rad2(const PlaneFit& plane, double thickness2_m2, int count) {
  return thickness2_m2 / (count * plane.eigenvalues[1] + 1e-12);
}

/// Variance across the plane of `count` points: three of their degrees of freedom went into it.
double thickness2_of_neighbours_m2(const PlaneFit& plane, std::size_t count);

}  // namespace trigpoint::lio_mapper
