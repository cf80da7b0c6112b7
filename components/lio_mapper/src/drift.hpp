// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How odom drifts, and where scans do not see it.
#pragma once

#include "trigpoint/lio_mapper/config.hpp"

#include "iterated_update.hpp"
#include "state.hpp"
#include <Eigen/Core>

namespace trigpoint::lio_mapper {

/// Variances that odom's drift gathers over a metre, axes of odom.
struct DriftRate {
  Eigen::Matrix3d position_m2{Eigen::Matrix3d::Zero()};
  Eigen::Matrix2d tilt_rad2{Eigen::Matrix2d::Zero()};
  double yaw_rad2{0.0};
};

/// The configured walk, and what the map inherits. New map is laid with the error that the pose has
/// relative to the old map. Neighbouring scans see the same patches and share that error, so it
/// does not average out from scan to scan; over the length on which patches are renewed its
/// covariance (ROS order) is passed on once.
DriftRate drift_rate(const DriftConfig& drift,
                     const Matrix6d& pose_covariance_in_local_map = Matrix6d::Zero());

/// Covariance that the drift of heading and position at `p_odom_m` adds to a transform
/// (yaw, x, y, z) from odom into a frame turned by `R_frame_odom`: the heading turns about the
/// robot, not about the origin of odom.
Eigen::Matrix4d drift_noise(const DriftRate& rate,
                            double distance_m,
                            const Eigen::Matrix3d& R_frame_odom,
                            const Eigen::Vector3d& p_odom_m);

/// Adds to `covariance` what odom may drift against map over `distance_m`: the noise above and a
/// tilt, which likewise turns odom about the robot. Before the alignment only the tilt.
void add_drift_noise(const DriftRate& rate,
                     double distance_m,
                     const State& state,
                     bool aligned,
                     ErrorMatrix& covariance);

/// Adds to `covariance` tilts of odom against gravity about odom's x and y, as long as it is nearly
/// level. Once there is an alignment they turn it about the robot.
void add_tilt_noise(const Eigen::Matrix2d& tilt_rad2,
                    const State& state,
                    bool aligned,
                    ErrorMatrix& covariance);

/// Share, 0 to 1 along each axis of odom, by which a scan with this information (1/m^2) leaves the
/// position so open that it does not hold the velocity either.
Eigen::Matrix3d blindness(const Eigen::Matrix3d& position_information);

/// Adds to `covariance` what gravity does over `elapsed_s` along axes that scans do not hold.
/// Where they hold the position they hold the velocity too. Where they do not, it is an integral,
/// and what it integrates is less the noise of the accelerometer than gravity through a tilt of the
/// map, which bends while it grows.
void add_blind_tilt_noise(const DriftConfig& drift,
                          double elapsed_s,
                          const Eigen::Matrix3d& blind,
                          const State& state,
                          bool aligned,
                          ErrorMatrix& covariance);

}  // namespace trigpoint::lio_mapper
