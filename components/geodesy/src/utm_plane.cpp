// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// References: [1] G. Bomford, "Geodesy", 4th ed., 1980, 2.4 (radii of curvature), 3.5 (scale and
// arc-to-chord correction of conformal projections). [2] J. P. Snyder, "Map projections: a working
// manual", USGS 1395, 1987, 8 (transverse Mercator).
#include "utm_plane.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace trigpoint::geodesy {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kSemiMajor_m = 6'378'137.0;
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kDerivativeStep_m = 500.0;

double square(double value) {
  return value * value;
}

/// Counter-clockwise.
Vector2d turned(const Vector2d& v, double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  return {c * v.x() - s * v.y(), s * v.x() + c * v.y()};
}

Vector2d grid_of(const UtmPosition& utm) {
  return {utm.easting_m, utm.northing_m};
}

}  // namespace

UtmPlane::UtmPlane(const Datum& datum) : zone_(utm_zone_of(datum)) {
  const auto origin = to_utm(place_of(datum), zone_);
  if (!origin) {
    throw std::invalid_argument("The datum at latitude " + std::to_string(datum.latitude_deg) +
                                " degrees has no UTM coordinates, expected -84 to 84.");
  }
  origin_ = *origin;
  const double e2 = kFlattening * (2.0 - kFlattening);
  const double w2 = 1.0 - e2 * square(std::sin(datum.latitude_deg * kDegree));
  normal_radius_m_ = kSemiMajor_m / std::sqrt(w2);
  meridian_radius_m_ = normal_radius_m_ * (1.0 - e2) / w2;
}

std::optional<double> UtmPlane::log_scale_at(const Vector2d& grid_m) const {
  const auto place = from_utm(grid_m.x(), grid_m.y(), 0.0, zone_);
  const auto utm = place ? to_utm(*place, zone_) : std::nullopt;
  return utm ? std::optional(std::log(utm->scale)) : std::nullopt;
}

std::optional<Vector3d> UtmPlane::to_map(const Geographic& place) const {
  const auto utm = to_utm(place, zone_);
  if (!utm) {
    return std::nullopt;
  }
  const Vector2d chord = grid_of(*utm) - grid_of(origin_);
  const double length = chord.norm();
  const double rise = utm->height_m - origin_.height_m;
  if (length < 1e-9) {
    return Vector3d(0.0, 0.0, rise);
  }
  const Vector2d along = chord / length;
  const Vector2d left(-along.y(), along.x());
  const Vector2d third = grid_of(origin_) + chord / 3.0;
  const auto middle = log_scale_at(grid_of(origin_) + 0.5 * chord);
  const auto to_left = log_scale_at(third + kDerivativeStep_m * left);
  const auto to_right = log_scale_at(third - kDerivativeStep_m * left);
  if (!middle || !to_left || !to_right) {
    return std::nullopt;
  }
  // True distance on the ellipsoid: the mean of 1 / scale along the way (Simpson).
  const double s =
      length * (1.0 / origin_.scale + 4.0 * std::exp(-*middle) + 1.0 / utm->scale) / 6.0;
  // A geodesic is bent on the grid, with the curvature d(log scale)/d(left); at its start it leaves
  // the chord by half of that times the length, taken at a third of the way ([1] 3.5).
  const double bend = 0.5 * length * (*to_left - *to_right) / (2.0 * kDerivativeStep_m);
  // True axes: clockwise by the convergence, which counts clockwise from true to grid north.
  const Vector2d direction = turned(along, bend - origin_.convergence_deg * kDegree);
  // On the ellipsoid an arc with Euler's radius of curvature in this direction; from its end up
  // along the vertical there, which leans by each axis' own curvature.
  const double radius =
      1.0 / (square(direction.y()) / meridian_radius_m_ + square(direction.x()) / normal_radius_m_);
  const double angle = s / radius;
  const double bow = 2.0 * square(std::sin(0.5 * angle));
  const Vector2d lean =
      radius * std::sin(angle) *
      Vector2d(direction.x() / normal_radius_m_, direction.y() / meridian_radius_m_);
  Vector3d position;
  position << radius * std::sin(angle) * direction + utm->height_m * lean,
      rise - radius * bow - 0.5 * utm->height_m * lean.squaredNorm();
  return position;
}

}  // namespace trigpoint::geodesy
