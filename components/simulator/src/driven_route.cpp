// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "route.hpp"
#include <Eigen/Core>

#include <algorithm>
#include <string>

namespace trigpoint::simulator {

namespace {

double length_m(const RoutePoint& from, const RoutePoint& to) {
  return Eigen::Vector2d(to.east_m - from.east_m, to.north_m - from.north_m).norm();
}

/// A speed holds from its point on: turned round, it belongs to the side's other end.
std::vector<RoutePoint> reversed(std::vector<RoutePoint> points) {
  for (std::size_t i = points.size() - 1; i > 0; --i) {
    points[i].speed_mps = points[i - 1].speed_mps;
  }
  std::reverse(points.begin(), points.end());
  return points;
}

std::vector<RoutePoint> without_first(const std::vector<RoutePoint>& points, double start_m) {
  double rest_m = start_m;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const double side_m = length_m(points[i], points[i + 1]);
    if (rest_m < side_m) {
      RoutePoint first = points[i];
      first.east_m += rest_m / side_m * (points[i + 1].east_m - first.east_m);
      first.north_m += rest_m / side_m * (points[i + 1].north_m - first.north_m);
      first.stop_s = rest_m > 0.0 ? 0.0 : first.stop_s;
      std::vector<RoutePoint> driven{first};
      driven.insert(
          driven.end(), points.begin() + static_cast<std::ptrdiff_t>(i) + 1, points.end());
      return driven;
    }
    rest_m -= side_m;
  }
  throw ConfigError("motion.start_m: the route ends " + std::to_string(start_m - rest_m) +
                    " m after its start; nothing would be left to drive");
}

}  // namespace

std::vector<RoutePoint> driven_route(const Scenario& scenario) {
  std::vector<RoutePoint> points = scenario.route->points();
  if (scenario.motion.reverse) {
    points = reversed(std::move(points));
  }
  return scenario.motion.start_m > 0.0 ? without_first(points, scenario.motion.start_m) : points;
}

}  // namespace trigpoint::simulator
