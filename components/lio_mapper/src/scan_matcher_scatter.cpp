// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a scan's residuals themselves say of how well it knows its pose.
#include "scan_matcher.hpp"
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <vector>

namespace trigpoint::lio_mapper {

namespace {

/// Kish's effective number of equal parts, of parts that sum to 1, less one: degrees of freedom of
/// what they scatter by. A t-distribution of so many has n / (n - 2) of the normal variance.
double trust_in_parts(double sum_of_squares) {
  const double freedom = 1.0 / sum_of_squares - 1.0;
  return freedom > 2.0 ? (freedom - 2.0) / freedom : 0.0;
}

}  // namespace

/// With A = L L^T and pulls s_p = sum w r h of the patches after the step, the covariance of the
/// solution is A^-1 B A^-1, B = sum s_p s_p^T. Along the eigenvectors v of L^-1 B L^-T it is as
/// many times the stated one as the eigenvalues say; the patches' parts of what A knows along v are
/// sum w (h . L^-T v)^2, which over all patches is 1.
Matrix6d ScanMatcher::information_by_patches() const {
  std::vector<Vector6d> pulls(patches_.size(), Vector6d::Zero());
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    if (found_[i] == Found::kPlane) {
      const Vector6d& h = scratch_.rows[i];
      pulls[residuals_[i].patch] +=
          residuals_[i].weight * (residuals_[i].residual_m + h.dot(scratch_.step)) * h;
    }
  }
  Matrix6d scatter = kUnseen * Matrix6d::Identity();
  for (const Vector6d& pull : pulls) {
    scatter.noalias() += pull * pull.transpose();
  }
  const Eigen::LLT<Matrix6d> root(scratch_.unweighed + kUnseen * Matrix6d::Identity());
  const Matrix6d half = root.matrixL().solve(scatter);
  const Matrix6d times_stated = root.matrixL().solve(half.transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(times_stated);
  const Matrix6d across = root.matrixU().solve(eigen.eigenvectors()).transpose();

  std::vector<Vector6d> parts(patches_.size(), Vector6d::Zero());
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    if (found_[i] == Found::kPlane) {
      parts[residuals_[i].patch] += residuals_[i].weight * (across * scratch_.rows[i]).cwiseAbs2();
    }
  }
  Vector6d squares = Vector6d::Zero();
  for (const Vector6d& part : parts) {
    squares += part.cwiseAbs2();
  }
  Vector6d believed = eigen.eigenvalues().cwiseMax(scratch_.least_scatter).cwiseInverse();
  for (int i = 0; i < 6; ++i) {
    believed[i] *= trust_in_parts(squares[i] + 1e-12);
  }
  const Matrix6d directions = root.matrixL() * eigen.eigenvectors();
  const Matrix6d kept = scratch_.kept * directions;
  return kept * believed.asDiagonal() * kept.transpose();
}

}  // namespace trigpoint::lio_mapper
