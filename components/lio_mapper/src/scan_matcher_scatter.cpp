// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a scan's residuals themselves say of how well it knows its pose.
#include "scan_matcher.hpp"
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <vector>

namespace trigpoint::lio_mapper {

namespace {

/// One patch of a scan: its parts of the normal equations.
struct PatchSum {
  Matrix6d information{Matrix6d::Zero()};
  Vector6d pull{Vector6d::Zero()};
};

/// Kish's effective number of equal parts, of parts that sum to 1, less one: degrees of freedom of
/// what they scatter by. A t-distribution of so many has n / (n - 2) of the normal variance.
double trust_in_parts(double sum_of_squares) {
  const double freedom = 1.0 / sum_of_squares - 1.0;
  return freedom > 2.0 ? (freedom - 2.0) / freedom : 0.0;
}

}  // namespace

/// With A = L L^T the sum of all patches' information, in coordinates in which A is the identity:
/// patch p has the share S_p and pulls by s_p = sum w r h after the step. The patches were fitted
/// to, so that what one of them pulls by when it is left out of the fit, (I - S_p)^-1 s_p, is what
/// it is wrong by (the estimate HC3 of clusters, or jackknife [J. G. MacKinnon, H. White, "Some
/// heteroskedasticity-consistent covariance matrix estimators with improved finite sample
/// properties", J. Econometrics 1985]). Along the eigenvectors of the sum of their squares the
/// solution has as many times the stated variance as the eigenvalues say.
Matrix6d ScanMatcher::information_by_patches() const {
  // Planes that go through the points that they explain are no witnesses of what they are worth.
  if (also_nearest_) {
    return Matrix6d::Zero();
  }
  std::vector<PatchSum> patches(patches_.size());
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    if (found_[i] == Found::kPlane) {
      const Residual& r = residuals_[i];
      const Vector6d& h = scratch_.rows[i];
      PatchSum& patch = patches[r.patch];
      patch.information.noalias() += (r.weight * h) * h.transpose();
      patch.pull += r.weight * (r.residual_m + h.dot(scratch_.step)) * h;
    }
  }
  const Eigen::LLT<Matrix6d> root(scratch_.unweighed + kUnseen * Matrix6d::Identity());
  Matrix6d scatter = Matrix6d::Zero();
  std::vector<Matrix6d> shares;
  shares.reserve(patches.size());
  for (const PatchSum& patch : patches) {
    shares.push_back(whitened(root, patch.information));
    const Vector6d left_out = (Matrix6d::Identity() - shares.back())
                                  .ldlt()
                                  .solve(root.matrixL().solve(patch.pull).eval());
    scatter.noalias() += left_out * left_out.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scatter);
  Vector6d believed = eigen.eigenvalues().cwiseMax(scratch_.least_scatter).cwiseInverse();
  for (int i = 0; i < 6; ++i) {
    const Vector6d axis = eigen.eigenvectors().col(i);
    double squares = 1e-12;
    for (const Matrix6d& share : shares) {
      const double part = axis.dot(share * axis);
      squares += part * part;
    }
    believed[i] *= trust_in_parts(squares);
  }
  const Matrix6d directions = root.matrixL() * eigen.eigenvectors();
  const Matrix6d kept = scratch_.kept * directions;
  return kept * believed.asDiagonal() * kept.transpose();
}

}  // namespace trigpoint::lio_mapper
