// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// IMU propagation of state and error.
// Reference: [1] J. Sola, "Quaternion kinematics for the error-state Kalman filter",
// arXiv:1711.02508, section 5 and appendix on integration (here: trapezoid in specific force).
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "state.hpp"
#include <Eigen/Core>

#include <vector>

namespace trigpoint::lio_mapper {

/// A sample in base axes: finite, in order.
struct InertialSample {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d gyro_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_mps2{Eigen::Vector3d::Zero()};
  bool saturated{false};  ///< an axis stands at the end of its range: the truth lies beyond
};

/// The sample between two others, linearly.
InertialSample interpolate(const InertialSample& a, const InertialSample& b, Nanoseconds stamp_ns);

/// A stretch of at most one IMU interval: what the two samples at its ends said.
struct InertialStep {
  InertialSample begin;
  InertialSample end;

  /// Of noise densities; over a sweep it lets a saturated gyro be wrong by some tenths of a rad/s.
  double noise_factor() const { return begin.saturated || end.saturated ? 100.0 : 1.0; }

  double duration_s() const { return to_seconds(end.stamp_ns - begin.stamp_ns); }
};

/// Transition F of the error over one step, in blocks; the rest is identity.
/// dtheta' = rotation dtheta + rotation_gyro dbg, da = the accel_* terms summed,
/// dv' = dv + da dt, dp' = dp + dv dt + da dt^2 / 2.
struct StepJacobian {
  double dt_s{0.0};
  Eigen::Matrix3d rotation;
  Eigen::Matrix3d rotation_gyro_bias;
  Eigen::Matrix3d accel_rotation;
  Eigen::Matrix3d accel_gyro_bias;
  Eigen::Matrix3d accel_accel_bias;
  Eigen::Matrix<double, 3, 2> accel_gravity;
};

State propagate(const State& state, const InertialStep& step);
StepJacobian step_jacobian(const State& state, const InertialStep& step);

/// matrix <- F matrix, without forming F.
void apply_transition(const StepJacobian& jacobian, ErrorMatrix& matrix);

/// Spectral densities of a step's white noise.
struct StepNoise {
  double gyro2{0.0};   ///< (rad/s)^2 / Hz
  double accel2{0.0};  ///< (m/s^2)^2 / Hz
};

/// `gap_s` is the longest interval between samples around the step. Inside a gap the motion is a
/// straight line between two samples, wrong by a motion that lasts: sigma over a gap T gives the
/// velocity's variance (sigma T)^2, hence the density sigma^2 T. Motions take time to build up, so
/// that sigma grows with T.
StepNoise noise_of(const ImuConfig& config, const InertialStep& step, double gap_s);

/// covariance <- F covariance F^T + Q.
void propagate_covariance(const StepJacobian& jacobian,
                          const ImuConfig& config,
                          const StepNoise& noise,
                          ErrorMatrix& covariance);

/// A pose on the way and what is needed to go on from it to the next one.
struct PathNode {
  Nanoseconds stamp_ns{0};
  Pose T_odom_base;
  Eigen::Vector3d v_odom_mps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d acceleration_odom_mps2{Eigen::Vector3d::Zero()};  ///< until the next node
  Eigen::Vector3d angular_radps{Eigen::Vector3d::Zero()};           ///< base axes, until the next
  double turn_variance_rad2{0.0};  ///< what the gyro's noise has added since the path began
};

/// Poses at IMU stamps between two scans, as propagated, oldest first.
class Path {
 public:
  void clear() { nodes_.clear(); }

  void push_back(const PathNode& node) { nodes_.push_back(node); }

  bool empty() const { return nodes_.empty(); }

  Nanoseconds begin_ns() const { return nodes_.front().stamp_ns; }

  Nanoseconds end_ns() const { return nodes_.back().stamp_ns; }

  const PathNode& back() const { return nodes_.back(); }

  const std::vector<PathNode>& nodes() const { return nodes_; }

  /// Before the first node and after the last one the motion of the nearest node goes on.
  Pose at(Nanoseconds stamp_ns) const;

  /// The path given that it ends at `T_odom_base`: each node moves by the share that its turn's
  /// variance has of the end's, which is its covariance with the end's error over the variance of
  /// that, as for any process with independent increments.
  Path ending_at(const Pose& T_odom_base) const;

  /// The path of another place on the robot, which lies at `T_base_other`; turn rates stay in base.
  Path seen_from(const Pose& T_base_other) const;

 private:
  std::vector<PathNode> nodes_;
};

}  // namespace trigpoint::lio_mapper
