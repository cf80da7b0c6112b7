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

/// Neighbouring scans share the map's errors: attitudes of so long, a window, count as one, and
/// more of them where windows differ by more.
constexpr double kShared_s = 3.0;
constexpr std::size_t kFewestAttitudes = 4;
/// Noise and excess are means over about so many windows.
constexpr double kMemory_windows = 15.0;
/// A turn is certain when its sigma is less than this share of that of the configuration.
constexpr double kCertain = 1.0 / 3.0;
/// An innovation beyond this many sigmas counts as that many.
constexpr double kInnovationClip = 3.0;
/// Windows are compared about an axis that on average left the line through its way by so much, as
/// in a turn of half a radian.
constexpr double kLeastSagitta_rad = 0.01;

using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

/// What a line through each column leaves of it.
Columns without_lines(const Columns& y, const Eigen::VectorXd& t) {
  Columns line(t.size(), 2);
  line << Eigen::VectorXd::Ones(t.size()), t.array() - t.mean();
  const Eigen::Matrix2d inner = line.transpose() * line;
  return y - line * inner.ldlt().solve(line.transpose() * y);
}

/// What a window says of the turn e that its attitudes lack: information * e = seen, in units of
/// one attitude's noise.
struct Told {
  Matrix3d information;
  Vector3d seen;
  double residual2_rad2;  ///< of one attitude
  double rate_hz;         ///< of attitudes
};

Told told_by(const AttitudeWindow& window) {
  const auto n = static_cast<Eigen::Index>(window.samples.size());
  // Columns: e, the clock's offset (a nuisance here, see clock_offset.hpp), y; an axis a block of
  // rows.
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
  const Eigen::Matrix<double, 5, 1> by_clock = sums.col(3);
  sums -= by_clock * by_clock.transpose() / (by_clock[3] + 1e-9);
  Told told;
  told.information = sums.topLeftCorner<3, 3>();
  told.seen = sums.topRightCorner<3, 1>();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(told.information);
  const Vector3d along = axes.eigenvectors().transpose() * told.seen;
  const double explained = along.cwiseAbs2().cwiseQuotient(axes.eigenvalues().cwiseMax(1e-9)).sum();
  const double freedom = 3.0 * static_cast<double>(n - 2) - 4.0;
  told.residual2_rad2 = std::max(0.0, sums(4, 4) - explained) / freedom;
  told.rate_hz = static_cast<double>(n - 1) / (t[n - 1] - t[0]);
  return told;
}

}  // namespace

ExtrinsicRotationEstimator::ExtrinsicRotationEstimator(double sigma_rad)
    : most_when_certain_rad2_(kCertain * kCertain * sigma_rad * sigma_rad),
      covariance_rad2_(sigma_rad * sigma_rad * Matrix3d::Identity()),
      excess_(1.0) {}

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
  if (window.samples.size() < kFewestAttitudes) {
    return;
  }
  const Told told = told_by(window);
  const double share = 1.0 / std::min(static_cast<double>(++windows_), kMemory_windows);
  noise2_rad2_ += share * (told.residual2_rad2 - noise2_rad2_);
  const double noise2 = std::max(noise2_rad2_, told.residual2_rad2);
  const double shared = std::max(1.0, kShared_s * told.rate_hz);
  const Vector3d lacking_rad = turn_rad_ - taken_base_rad;

  // How well this window agrees with those before, about the axes that it tells something of.
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(told.information);
  const double least =
      static_cast<double>(window.samples.size()) * kLeastSagitta_rad * kLeastSagitta_rad;
  double ratio2 = 0.0;
  int count = 0;
  for (int i = 0; i < 3; ++i) {
    const double known = axes.eigenvalues()[i];
    if (known > least) {
      const Vector3d axis = axes.eigenvectors().col(i);
      const double innovation = axis.dot(told.seen) / known - axis.dot(lacking_rad);
      ratio2 += innovation * innovation /
                (axis.dot(covariance_rad2_ * axis) + excess_ * shared * noise2 / known);
      ++count;
    }
  }
  double robust = 1.0;
  if (count > 0) {
    ratio2 /= count;
    const double clipped = std::min(ratio2, kInnovationClip * kInnovationClip);
    const double memory =
        std::min(static_cast<double>(++turns_) + kMemory_windows / 3.0, kMemory_windows);
    excess_ = std::max(1.0, excess_ + (clipped * excess_ - excess_) / memory);
    robust = std::max(1.0, std::sqrt(ratio2) / kInnovationClip);
  }
  const double per_rad2 = 1.0 / (excess_ * shared * robust * noise2 + 1e-12);
  covariance_rad2_ = (Matrix3d::Identity() + per_rad2 * covariance_rad2_ * told.information)
                         .partialPivLu()
                         .solve(covariance_rad2_)
                         .eval();
  covariance_rad2_ = (0.5 * (covariance_rad2_ + covariance_rad2_.transpose())).eval();
  turn_rad_ += covariance_rad2_ * per_rad2 * (told.seen - told.information * lacking_rad);
}

}  // namespace trigpoint::lio_mapper
