// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/fused_odometry.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kStep = 1e-6;
constexpr double kDerivativeTolerance = 1e-7;

Odometry some_odometry() {
  Odometry odometry;
  odometry.stamp_ns = 5;
  odometry.frame_id = "odom";
  odometry.child_frame_id = "base_link";
  odometry.T_frame_child = {from_roll_pitch_yaw({0.2, -0.3, 1.1}), {30.0, -12.0, 4.0}};
  const Matrix6d root = (Matrix6d() << 1,
                         0,
                         0,
                         0,
                         0,
                         0,
                         .2,
                         2,
                         0,
                         0,
                         0,
                         0,
                         .3,
                         .1,
                         1,
                         0,
                         0,
                         0,
                         .1,
                         0,
                         .2,
                         .5,
                         0,
                         0,
                         0,
                         .3,
                         0,
                         .1,
                         .4,
                         0,
                         .2,
                         0,
                         .1,
                         0,
                         .1,
                         .3)
                            .finished();
  odometry.pose_covariance = root * root.transpose() * 0.01;
  return odometry;
}

const YawPose kT{0.7, {5.0, 6.0, 7.0}};

/// Position and rotation (fixed axes of the parent) of `moved` relative to `base`.
Eigen::Matrix<double, 6, 1> difference(const Pose& moved, const Pose& base) {
  Eigen::Matrix<double, 6, 1> result;
  result << moved.p - base.p, so3_log(moved.q * base.q.conjugate());
  return result;
}

Eigen::Matrix4d T_covariance() {
  const Eigen::Matrix4d root =
      (Eigen::Matrix4d() << .02, 0, 0, 0, .1, .3, 0, 0, -.2, .1, .2, 0, 0, 0, .05, .4).finished();
  return root * root.transpose();
}

TEST(FusedOdometry, is_the_transform_times_the_pose) {
  const Odometry lio = some_odometry();
  const Odometry fused = fuse(lio, kT, T_covariance());
  EXPECT_EQ(fused.frame_id, "map");
  EXPECT_EQ(fused.child_frame_id, "base_link");
  EXPECT_NEAR(
      (fused.T_frame_child.p - (from_yaw(0.7) * lio.T_frame_child.p + kT.p)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(
      fused.T_frame_child.q.angularDistance(from_yaw(0.7) * lio.T_frame_child.q), 0.0, 1e-7);
}

TEST(FusedOdometry, has_the_covariance_of_a_numerical_jacobian) {
  const Odometry lio = some_odometry();
  const Pose nominal = kT.pose() * lio.T_frame_child;
  Eigen::Matrix<double, 6, 10> jacobian;  // pose: x y z r p y; transform: yaw x y z
  for (int k = 0; k < 10; ++k) {
    Pose pose = lio.T_frame_child;
    YawPose T = kT;
    if (k < 3) {
      pose.p[k] += kStep;
    } else if (k < 6) {
      pose.q = so3_exp(kStep * Eigen::Vector3d::Unit(k - 3)) * pose.q;
    } else if (k == 6) {
      T.yaw_rad += kStep;
    } else {
      T.p[k - 7] += kStep;
    }
    jacobian.col(k) = difference(T.pose() * pose, nominal) / kStep;
  }
  Eigen::Matrix<double, 10, 10> inputs = Eigen::Matrix<double, 10, 10>::Zero();
  inputs.topLeftCorner<6, 6>() = lio.pose_covariance;
  inputs.bottomRightCorner<4, 4>() = T_covariance();
  const Matrix6d expected = jacobian * inputs * jacobian.transpose();
  const Matrix6d actual = fuse(lio, kT, T_covariance()).pose_covariance;
  EXPECT_LT((actual - expected).norm() / expected.norm(), kDerivativeTolerance * 100.0);
  EXPECT_GT((actual - lio.pose_covariance).norm(), 0.1);
}

TEST(FusedOdometry, moves_an_antenna_to_the_base_with_its_covariance) {
  const Eigen::Vector3d lever_m{0.3, -0.1, 0.9};
  Odometry gps = some_odometry();
  gps.child_frame_id = kAntennaFrame;
  const Odometry base = move_to_base(gps, lever_m);
  EXPECT_NEAR((base.T_frame_child * lever_m - gps.T_frame_child.p).norm(), 0.0, 1e-12);
  Matrix6d jacobian;
  for (int k = 0; k < 6; ++k) {
    Odometry moved = gps;
    if (k < 3) {
      moved.T_frame_child.p[k] += kStep;
    } else {
      moved.T_frame_child.q = so3_exp(kStep * Eigen::Vector3d::Unit(k - 3)) * moved.T_frame_child.q;
    }
    jacobian.col(k) =
        difference(move_to_base(moved, lever_m).T_frame_child, base.T_frame_child) / kStep;
  }
  const Matrix6d expected = jacobian * gps.pose_covariance * jacobian.transpose();
  EXPECT_LT((base.pose_covariance - expected).norm() / expected.norm(),
            kDerivativeTolerance * 100.0);
}

TEST(FusedOdometry, admits_the_lever_arm_as_an_error_where_the_heading_is_unknown) {
  Odometry gps;
  gps.child_frame_id = kAntennaFrame;
  gps.pose_covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * 0.01;
  const Odometry base = move_to_base(gps, {0.0, 0.0, 2.0});
  EXPECT_NEAR(base.pose_covariance(0, 0), 4.01, 1e-12);
}

TEST(FusedOdometry, carries_the_tilt_of_odom_to_the_robot_as_numerical_differences_say) {
  Odometry lio;
  lio.T_frame_child.p = {40.0, -25.0, 3.0};
  lio.pose_covariance.setZero();
  const YawPose T{0.7, {5.0, 6.0, 7.0}, {0.01, -0.02}};
  for (int axis = 0; axis < 2; ++axis) {
    Matrix6d covariance = Matrix6d::Zero();
    covariance(4 + axis, 4 + axis) = 1.0;
    YawPose plus = T;
    YawPose minus = T;
    plus.tilt_rad[axis] += kStep;
    minus.tilt_rad[axis] -= kStep;
    const Pose a = plus.pose() * lio.T_frame_child;
    const Pose b = minus.pose() * lio.T_frame_child;
    Eigen::Matrix<double, 6, 1> column;
    column << (a.p - b.p) / (2.0 * kStep), so3_log(a.q * b.q.conjugate()) / (2.0 * kStep);
    const Matrix6d difference =
        fuse(lio, T, covariance).pose_covariance - column * column.transpose();
    EXPECT_LT(difference.norm(), 1e-4) << "tilt axis " << axis;
  }
}

}  // namespace
}  // namespace trigpoint::fusion_gate
