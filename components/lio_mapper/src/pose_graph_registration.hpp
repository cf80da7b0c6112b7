// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A cloud against a local map, from a place that is known to a metre.
#pragma once

#include "trigpoint/base/pose.hpp"

#include "local_map.hpp"
#include <Eigen/Core>

#include <optional>
#include <vector>

namespace trigpoint::lio_mapper {

struct CloudFit {
  Pose T_map_cloud;
  /// x y z in axes of the map, rotation about axes of the cloud; wide where the surfaces leave a
  /// direction free.
  Eigen::Matrix<double, 6, 6> covariance{Eigen::Matrix<double, 6, 6>::Identity()};
  double overlap{0.0};  ///< of the points, those that meet a plane
  double fit{0.0};      ///< of these, those within 10 cm of it
};

/// Point-to-plane Gauss-Newton with a weight that narrows from step to step, so that what is far
/// off at the start still pulls and what stays far off (people, cars) no longer does. The start
/// itself counts with a metre and 3 degrees: along a corridor the cloud stays. Nothing when hardly
/// a point meets a plane or the steps do not end.
std::optional<CloudFit> fit_cloud(const std::vector<Eigen::Vector3d>& points_m,
                                  const LocalMap& map,
                                  const Pose& T_map_cloud);

}  // namespace trigpoint::lio_mapper
