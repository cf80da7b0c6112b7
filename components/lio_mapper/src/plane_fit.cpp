// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "plane_fit.hpp"

#include <Eigen/Eigenvalues>

namespace trigpoint::lio_mapper {

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

}  // namespace trigpoint::lio_mapper
