// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "routes/waypoints.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

namespace {

constexpr double kSharpestTurn_rad = 150.0 * std::numbers::pi / 180.0;
constexpr double kArcStep_rad = 0.05;

Eigen::Vector2d place(const RoutePoint& point) {
  return {point.east_m, point.north_m};
}

/// The corner as an arc that touches both sides at most at their middles.
void append_arc(const RoutePoint& before,
                const RoutePoint& corner,
                const RoutePoint& after,
                double radius_m,
                std::vector<RoutePoint>& points) {
  const Eigen::Vector2d in = place(corner) - place(before);
  const Eigen::Vector2d out = place(after) - place(corner);
  const Eigen::Vector2d u = in.normalized();
  const Eigen::Vector2d w = out.normalized();
  const double turn = std::atan2(u.x() * w.y() - u.y() * w.x(), u.dot(w));
  if (std::abs(turn) < 1e-3) {
    points.push_back(corner);
    return;
  }
  if (std::abs(turn) > kSharpestTurn_rad) {
    throw ConfigError("route: the corner at east " + std::to_string(corner.east_m) + " m, north " +
                      std::to_string(corner.north_m) + " m turns by " +
                      std::to_string(std::abs(turn) * 180.0 / std::numbers::pi) +
                      " degrees; at most 150 can be driven, insert another waypoint");
  }
  const double half = std::tan(0.5 * std::abs(turn));
  const double tangent_m = std::min({radius_m * half, 0.5 * in.norm(), 0.5 * out.norm()});
  const double r = tangent_m / half;
  const double side = turn > 0.0 ? 1.0 : -1.0;
  const Eigen::Vector2d start = place(corner) - tangent_m * u;
  const Eigen::Vector2d centre = start + side * r * Eigen::Vector2d(-u.y(), u.x());
  const int steps = std::max(2, static_cast<int>(std::ceil(std::abs(turn) / kArcStep_rad)));
  const double first = std::atan2(start.y() - centre.y(), start.x() - centre.x());
  for (int i = 0; i <= steps; ++i) {
    const double angle = first + turn * i / steps;
    RoutePoint point = corner;
    point.east_m = centre.x() + r * std::cos(angle);
    point.north_m = centre.y() + r * std::sin(angle);
    point.stop_s = i == steps / 2 ? corner.stop_s : 0.0;
    points.push_back(point);
  }
}

}  // namespace

void Waypoints::describe(ConfigFields& fields) {
  fields.number("corner_radius_m", corner_radius_m_, "of the arcs at the corners", {1.0, 1000.0});
  fields.list(
      "waypoints",
      corners_.size(),
      "corners of the route, in order",
      [this](std::size_t size) { corners_.assign(size, RoutePoint{}); },
      [this](ConfigFields& item, std::size_t i) {
        RoutePoint& corner = corners_[i];
        item.number("east_m", corner.east_m, "in map");
        item.number("north_m", corner.north_m, "in map");
        item.number("speed_mps", corner.speed_mps, "wanted from here on", {0.2, 40.0});
        item.number("stop_s", corner.stop_s, "stand here that long", kNotNegative);
      });
}

std::vector<RoutePoint> Waypoints::points() const {
  if (corners_.size() < 2) {
    throw ConfigError("route: needs at least 2 waypoints; has " + std::to_string(corners_.size()));
  }
  for (std::size_t i = 1; i < corners_.size(); ++i) {
    if ((place(corners_[i]) - place(corners_[i - 1])).norm() < 0.5) {
      throw ConfigError("route: waypoints " + std::to_string(i - 1) + " and " + std::to_string(i) +
                        " are less than 0.5 m apart");
    }
  }
  std::vector<RoutePoint> points{corners_.front()};
  for (std::size_t i = 1; i + 1 < corners_.size(); ++i) {
    append_arc(corners_[i - 1], corners_[i], corners_[i + 1], corner_radius_m_, points);
  }
  points.push_back(corners_.back());
  return points;
}

}  // namespace trigpoint::simulator
