// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/geodesy/local_frame.hpp"

#include <Eigen/Core>

#include <optional>

namespace trigpoint::geodesy {

/// East, north, up at the datum by way of UTM: the paper's equations (6)-(7) in standard form,
/// p = R(psi)^T (p_grid - p_grid0), where what turns the grid's axes to true ones is the
/// convergence at the datum, and with what they leave out: scale, the bend of straight lines on the
/// grid, the height above the ellipsoid and the Earth's curvature. Zone and hemisphere are the
/// datum's.
class UtmPlane {
 public:
  /// Throws std::invalid_argument where UTM ends (|lat| > 84).
  explicit UtmPlane(const Datum& datum);

  std::optional<Eigen::Vector3d> to_map(const Geographic& place) const;

 private:
  std::optional<double> log_scale_at(const Eigen::Vector2d& grid_m) const;

  UtmZone zone_;
  UtmPosition origin_;
  double meridian_radius_m_;  ///< of curvature, north-south
  double normal_radius_m_;    ///< of curvature, east-west
};

}  // namespace trigpoint::geodesy
