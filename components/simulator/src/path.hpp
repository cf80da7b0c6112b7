// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "route.hpp"
#include <Eigen/Core>

#include <vector>

namespace trigpoint::simulator {

/// Radius of the circle in a route that is driven as one of `radius_m` (at least 2 m) once the path
/// is rounded. The robot is then slower than the route's speed by the same factor.
double radius_before_rounding_m(double radius_m);

/// A route as a smooth curve over its length: corners rounded by two moving averages, so that the
/// curvature is continuous; straight on beyond both ends.
class Path {
 public:
  explicit Path(const std::vector<RoutePoint>& route);

  struct Place {
    Eigen::Vector2d position_m;
    double heading_rad;  ///< unwrapped: continuous along the path
    double curvature_radpm;
  };

  Place at(double s_m) const;

  double length_m() const { return length_m_; }

  struct Stop {
    double s_m;
    double duration_s;
  };

  double wanted_speed_mps(double s_m) const;

  const std::vector<Stop>& stops() const { return stops_; }

 private:
  void sample(const std::vector<RoutePoint>& route);
  void smooth();
  void measure_headings();

  std::vector<Eigen::Vector2d> points_;  ///< every kStep_m, with a margin at both ends
  std::vector<double> headings_rad_;
  std::vector<double> speeds_mps_;
  std::vector<Stop> stops_;
  double length_m_{0.0};
};

}  // namespace trigpoint::simulator
