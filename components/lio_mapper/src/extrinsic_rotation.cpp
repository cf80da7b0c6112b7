// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "extrinsic_rotation.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// Neighbouring scans share the map's errors: 2 s of attitudes count as one, and more where windows
/// differ by more.
constexpr double kShared = 20.0;
/// Noise and excess are means over about so many windows.
constexpr double kMemory = 15.0;
/// A turn is certain when its sigma is less than this share of that of the configuration.
constexpr double kCertain = 0.25;
/// An innovation beyond this many sigmas counts as that many.
constexpr double kInnovationClip = 3.0;
/// A window in which an axis of base turned by less than about this says nothing, and little of how
/// well windows agree.
constexpr double kLeastTurn_rad = 0.1;

using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

/// What a line through each column leaves of it.
Columns without_lines(const Columns& y, const Eigen::VectorXd& t) {
  Columns line(t.size(), 2);
  line << Eigen::VectorXd::Ones(t.size()), t.array() - t.mean();
  const Eigen::Matrix2d inner = line.transpose() * line;
  return y - line * inner.ldlt().solve(line.transpose() * y);
}

}  // namespace

ExtrinsicRotationEstimator::ExtrinsicRotationEstimator(double sigma_rad)
    : most_when_certain_rad2_(kCertain * kCertain * sigma_rad * sigma_rad),
      covariance_rad2_(sigma_rad * sigma_rad * Matrix3d::Identity()),
      excess_(kShared) {}

Vector3d ExtrinsicRotationEstimator::certain_turn_base_rad() const {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(covariance_rad2_);
  Vector3d along = axes.eigenvectors().transpose() * turn_rad_;
  for (int i = 0; i < 3; ++i) {
    along[i] = axes.eigenvalues()[i] < most_when_certain_rad2_ ? along[i] : 0.0;
  }
  return axes.eigenvectors() * along;
}

Matrix3d ExtrinsicRotationEstimator::certain_covariance() const {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(covariance_rad2_);
  Vector3d variances = axes.eigenvalues();
  for (int i = 0; i < 3; ++i) {
    if (!(variances[i] < most_when_certain_rad2_)) {
      variances[i] = most_when_certain_rad2_ / (kCertain * kCertain);
    }
  }
  return axes.eigenvectors() * variances.asDiagonal() * axes.eigenvectors().transpose();
}

void ExtrinsicRotationEstimator::add(const AttitudeWindow& window, const Vector3d& taken_base_rad) {
  const auto n = static_cast<Eigen::Index>(window.samples.size());
  if (n < 3) {
    return;
  }
  // Columns: e, the clock's offset (a nuisance here, see clock_offset.hpp), y; rows: an axis a
  // block.
  Eigen::VectorXd t(n);
  Columns all = Columns::Zero(3 * n, 5);
  for (Eigen::Index i = 0; i < n; ++i) {
    const AttitudeSample& sample = window.samples[static_cast<std::size_t>(i)];
    t[i] = sample.time_s;
    const Matrix3d R = sample.q_gyro.toRotationMatrix();  // whose noise is less than the scan's
    const Vector3d y = sample.difference_rad();
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      all.row(axis * n + i) << R.row(axis), sample.rate_odom_radps[axis], y[axis];
    }
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    all.middleRows(axis * n, n) = without_lines(all.middleRows(axis * n, n), t);
  }
  Eigen::Matrix<double, 5, 5> sums = all.transpose() * all;
  // The clock's offset takes what it explains.
  const double clock = sums(3, 3) + 1e-9;
  const Eigen::Matrix<double, 5, 1> by_clock = sums.col(3);
  sums -= by_clock * by_clock.transpose() / clock;
  const Matrix3d information = sums.topLeftCorner<3, 3>();
  const Vector3d seen = sums.topRightCorner<3, 1>();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(information);
  const Vector3d known = axes.eigenvalues().cwiseMax(1e-9);
  const Vector3d along = axes.eigenvectors().transpose() * seen;
  const double explained = along.cwiseAbs2().cwiseQuotient(known).sum();
  const double freedom = 3.0 * static_cast<double>(n - 2) - 4.0;
  const double residual2 = std::max(0.0, sums(4, 4) - explained) / freedom;
  const double share = 1.0 / std::min(static_cast<double>(++windows_), kMemory);
  noise2_rad2_ += share * (residual2 - noise2_rad2_);

  const double noise2 = std::max(noise2_rad2_, residual2);
  const double least =
      static_cast<double>(n) * kLeastTurn_rad * kLeastTurn_rad * kLeastTurn_rad * kLeastTurn_rad;
  const Matrix3d inverse =
      axes.eigenvectors() * known.cwiseInverse().asDiagonal() * axes.eigenvectors().transpose();
  const Vector3d lacking_rad = turn_rad_ - taken_base_rad;
  const Vector3d innovation = inverse * seen - lacking_rad;
  double ratio2 = 0.0;
  int told = 0;
  const Matrix3d S = covariance_rad2_ + excess_ * noise2 * inverse;
  for (int i = 0; i < 3; ++i) {
    if (known[i] > least) {
      const Vector3d axis = axes.eigenvectors().col(i);
      const double along_axis = axis.dot(innovation);
      ratio2 += along_axis * along_axis / axis.dot(S * axis);
      ++told;
    }
  }
  double robust = 1.0;
  if (told > 0) {
    ratio2 /= told;
    ++turns_;
    const double clipped = std::min(ratio2, kInnovationClip * kInnovationClip);
    const double memory = std::min(static_cast<double>(turns_) + kMemory / 3.0, kMemory);
    excess_ = std::max(kShared, excess_ + (clipped * excess_ - excess_) / memory);
    robust = std::max(1.0, std::sqrt(ratio2) / kInnovationClip);
  }
  const double per_rad2 = 1.0 / (excess_ * robust * noise2 + 1e-12);
  covariance_rad2_ = (Matrix3d::Identity() + per_rad2 * covariance_rad2_ * information)
                         .partialPivLu()
                         .solve(covariance_rad2_)
                         .eval();
  covariance_rad2_ = (0.5 * (covariance_rad2_ + covariance_rad2_.transpose())).eval();
  turn_rad_ += covariance_rad2_ * per_rad2 * (seen - information * lacking_rad);
}

}  // namespace trigpoint::lio_mapper
