// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "drift.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

namespace {

/// What is larger stays the same error for long, as in a tunnel, and is the pose's own: passed on
/// every metre it would leave the pose nothing to learn from GPS.
constexpr double kMostInherited_m = 0.03;
constexpr double kMostInherited_rad = 0.003;
/// One scan that leaves the position more open than this does not hold the velocity.
constexpr double kHeld_m = 0.3;

}  // namespace

DriftRate drift_rate(const DriftConfig& drift, const Matrix6d& local) {
  const double inherited = drift.map_renewal_per_m;
  const auto square = [](double x) { return x * x; };
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(local.topLeftCorner<3, 3>());
  const Matrix3d position_m2 =
      axes.eigenvectors() *
      axes.eigenvalues().cwiseMax(0.0).cwiseMin(square(kMostInherited_m)).asDiagonal() *
      axes.eigenvectors().transpose();
  const double most_rad2 = square(kMostInherited_rad);
  DriftRate rate;
  rate.position_m2 =
      square(drift.position_sigma_m_sqrtm) * Matrix3d::Identity() + inherited * position_m2;
  const Eigen::Matrix2d tilt_rad2 = local.block<2, 2>(3, 3);
  rate.tilt_rad2 =
      square(drift.tilt_sigma_rad_sqrtm) * Eigen::Matrix2d::Identity() +
      inherited * std::min(most_rad2, tilt_rad2.trace()) * tilt_rad2 / (tilt_rad2.trace() + 1e-18);
  rate.yaw_rad2 = square(drift.yaw_sigma_rad_sqrtm) + inherited * std::min(most_rad2, local(5, 5));
  return rate;
}

Matrix4d drift_noise(const DriftRate& rate,
                     double distance_m,
                     const Matrix3d& R_frame_odom,
                     const Vector3d& p_odom_m) {
  Eigen::Vector4d turn = Eigen::Vector4d::UnitX();
  turn.tail<3>() = -Vector3d::UnitZ().cross(R_frame_odom * p_odom_m);
  Matrix4d noise = rate.yaw_rad2 * distance_m * turn * turn.transpose();
  noise.bottomRightCorner<3, 3>() +=
      distance_m * R_frame_odom * rate.position_m2 * R_frame_odom.transpose();
  return noise;
}

void add_tilt_noise(const Eigen::Matrix2d& tilt_rad2,
                    const State& state,
                    bool aligned,
                    ErrorMatrix& covariance) {
  Eigen::Matrix<double, error::kSize, 2> tilt = Eigen::Matrix<double, error::kSize, 2>::Zero();
  tilt.middleRows<2>(error::kGravity).setIdentity();
  if (aligned) {
    tilt.middleRows<3>(error::kPositionMapOdom) =
        -placed_point_by_gravity(state, state.T_odom_base.p);
  }
  covariance += tilt * tilt_rad2 * tilt.transpose();
}

void add_drift_noise(const DriftRate& rate,
                     double distance_m,
                     const State& state,
                     bool aligned,
                     ErrorMatrix& covariance) {
  if (aligned) {
    covariance.block<4, 4>(error::kYawMapOdom, error::kYawMapOdom) += drift_noise(
        rate, distance_m, state.placement().pose().q.toRotationMatrix(), state.T_odom_base.p);
  }
  add_tilt_noise(distance_m * rate.tilt_rad2, state, aligned, covariance);
}

Matrix3d blindness(const Matrix3d& position_information) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(position_information);
  const Eigen::Array3d held = axes.eigenvalues().array().max(0.0) * kHeld_m * kHeld_m;
  return axes.eigenvectors() * (1.0 + held).inverse().matrix().asDiagonal() *
         axes.eigenvectors().transpose();
}

void add_blind_tilt_noise(const DriftConfig& drift,
                          double elapsed_s,
                          const Matrix3d& blind,
                          const State& state,
                          bool aligned,
                          ErrorMatrix& covariance) {
  // Along x gravity comes in by a turn about y, along y by one about x.
  Eigen::Matrix2d turn;
  turn << 0.0, -1.0, 1.0, 0.0;
  const double walk2 = drift.blind_tilt_rad_sqrts * drift.blind_tilt_rad_sqrts;
  add_tilt_noise(walk2 * elapsed_s * turn * blind.topLeftCorner<2, 2>() * turn.transpose(),
                 state,
                 aligned,
                 covariance);
}

}  // namespace trigpoint::lio_mapper
