// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// GPS against LIO: by how much do they differ, and by how much may they?
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include "checks/sighting.hpp"
#include <Eigen/Core>

namespace trigpoint::fusion_gate {

/// A difference in map and its covariance.
struct Difference {
  Eigen::Vector3d d_map_m{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Identity()};
};

/// How many sigmas of one normal variable the part's difference is worth: its Mahalanobis distance,
/// for the level (2 degrees of freedom) turned into the sigmas of equal probability.
double sigmas_of(const Difference& difference, Part part);

/// The part's length of the difference.
double size_of(const Difference& difference, Part part);

/// The largest length along the difference that `sigmas` permit.
double permitted_m(const Difference& difference, Part part, double sigmas);

/// What LIO may have drifted between two moments, axes of odom: the larger of a random
/// walk and a share of the distance, and the whole of the distance driven blind.
Eigen::Vector3d lio_drift_variance_m2(const Eigen::Vector3d& blind_m,
                                      double distance_m,
                                      const Config& config);

/// GPS displacement less LIO displacement turned by T_map_odom's yaw. Its covariance: both fixes,
/// LIO's drift on the way, and the yaw's and the tilt's uncertainty over the displacement. The
/// translation of T_map_odom, and whatever GPS did to it, has no part in it.
Difference compare_displacement(const Sighting& from,
                                const Sighting& to,
                                const LioStatus& lio,
                                const Config& config);

}  // namespace trigpoint::fusion_gate
