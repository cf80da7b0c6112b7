// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The 4-DoF transform (yaw, x, y, z) between two level frames from matched positions, and where the
// source is a grid (UTM) its horizontal scale.
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

/// How far LIO may have slid since a moment, along the axes of odom, beyond its drift.
struct Slide {
  Eigen::Vector3d then_m2{Eigen::Vector3d::Zero()};       ///< variance of LIO's place then
  Eigen::Vector3d changed_m2{Eigen::Vector3d::Zero()};    ///< by which it differed most since
  Eigen::Vector3d inherited_m2{Eigen::Vector3d::Zero()};  ///< what new map took over from it

  Eigen::Vector3d variance_m2() const { return changed_m2 + inherited_m2; }
};

/// The antenna at one moment, seen from both sides.
struct AlignmentPair {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d p_map_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d variance_map_m2{Eigen::Vector3d::Ones()};  ///< of p_map_m, per axis
  Eigen::Vector3d p_odom_m{Eigen::Vector3d::Zero()};
  double distance_m{0.0};  ///< driven when the pair was made
  /// Of its variance, when the residuals testify that it is smaller: what the receiver itself says.
  double least_share{1.0};
  Slide slide{};  ///< since then
  /// What the receiver itself said less p_map_m, east and north: a filter smooths what it scatters.
  Eigen::Vector2d received_off_m{Eigen::Vector2d::Zero()};
  double said_m2{0.0};  ///< the variance that it claimed for it, along east or north
};

struct AlignmentSolution {
  YawPose T_map_odom;          ///< as of the newest pair
  Eigen::Matrix4d covariance;  ///< yaw, x, y, z; already scaled by what the residuals show
  double scale{1.0};           ///< p_map = T_map_odom (scale x, scale y, z)
  /// Of the scale: with yaw, x, y, z, and its variance.
  Eigen::Matrix<double, 5, 1> scale_covariance{Eigen::Matrix<double, 5, 1>::Zero()};
  double baseline_m{0.0};  ///< horizontal extent of the pairs
  double chi_square{0.0};  ///< of the residuals, correlations included
  double chi_square_limit{0.0};
  double outlier_share{0.0};
  std::size_t pairs{0};
  /// Of the receiver's own fixes (where they are not known, of the pairs) about the solution, along
  /// east or north.
  double received_m2{0.0};
  double said_m2{0.0};              ///< median of what it claimed for them
  bool contradicts_heading{false};  ///< which was left out therefore

  double yaw_sigma_rad() const;
};

/// What a measured heading says about T_map_odom; its error is not that of the fixes.
struct YawPrior {
  double yaw_rad{0.0};
  double sigma_rad{0.0};
};

/// Robust generalised least squares (README, "Alignment"); nullopt without pairs or when nothing
/// finite comes out. Pairs in the order of their stamps. A single pair gives a solution too, with
/// a yaw sigma that says that yaw is not known. `scale_sigma`: prior of the scale about 1; 0: it is
/// 1 (a LiDAR measures true distances). With a heading the search begins at it.
std::optional<AlignmentSolution> solve_alignment(const std::vector<AlignmentPair>& pairs,
                                                 const AlignmentConfig& config,
                                                 double scale_sigma = 0.0,
                                                 const std::optional<YawPrior>& heading = {});

/// Why the solution must not be used yet, as a sentence; nullopt when it may.
std::optional<std::string> find_obstacle(const AlignmentSolution& solution,
                                         const AlignmentConfig& config);

}  // namespace trigpoint::fusion_gate
