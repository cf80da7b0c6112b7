// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "plane_fit.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

/// A line through the points lets the plane turn about it (middle over largest spread).
constexpr double kLeastNeighbourLinearity = 0.01;

}  // namespace

std::optional<PlaneFit> fit_plane(const Moments& moments) {
  if (moments.count < 3) {
    return std::nullopt;
  }
  const double n = moments.count;
  PlaneFit fit;
  fit.centroid = moments.sum.matrix() / n;
  const Eigen::Matrix3d covariance = moments.outer() / n - fit.centroid * fit.centroid.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  fit.eigenvalues = solver.eigenvalues().cwiseMax(0.0);
  fit.normal = solver.eigenvectors().col(0).normalized();
  if (!(fit.eigenvalues[2] > 0.0) || !fit.normal.allFinite()) {
    return std::nullopt;
  }
  Eigen::Index largest = 0;
  fit.normal.cwiseAbs().maxCoeff(&largest);
  if (fit.normal[largest] < 0.0) {
    fit.normal = -fit.normal;
  }
  return fit;
}

std::optional<PlaneFit> fit_neighbours(std::span<const Eigen::Vector3d> points,
                                       double max_distance_m) {
  Moments moments;
  for (const Eigen::Vector3d& point : points) {
    moments.add(point);
  }
  auto fit = fit_plane(moments);
  if (!fit || fit->linearity() < kLeastNeighbourLinearity) {
    return std::nullopt;
  }
  const bool flat = std::all_of(points.begin(), points.end(), [&](const Eigen::Vector3d& point) {
    return std::abs(fit->normal.dot(point - fit->centroid)) <= max_distance_m;
  });
  return flat ? fit : std::nullopt;
}

double thickness2_of_neighbours_m2(const PlaneFit& plane, std::size_t count) {
  const auto n = static_cast<double>(count);
  return n / (n - 3.0) * plane.eigenvalues[0] + kThicknessFloor2_m2;
}

}  // namespace trigpoint::lio_mapper
