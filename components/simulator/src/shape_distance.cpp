// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "shape_distance.hpp"

#include <cmath>

namespace trigpoint::simulator {

namespace {

/// `beyond`: how far beyond the faces along each axis, negative inside.
template <typename Vector>
double distance_of(const Vector& beyond) {
  const double most_m = beyond.maxCoeff();
  return most_m <= 0.0 ? -most_m : beyond.cwiseMax(0.0).norm();
}

}  // namespace

double surface_distance_m(const Shape& shape, const Eigen::Vector3d& p_map_m) {
  const Eigen::Vector3d d = p_map_m - shape.centre_m;
  if (shape.kind == Shape::Kind::kCylinder) {
    return distance_of(Eigen::Vector2d(std::hypot(d.x(), d.y()) - shape.half_m.x(),
                                       std::abs(d.z()) - shape.half_m.z()));
  }
  const Eigen::Vector3d q(shape.cos_yaw * d.x() + shape.sin_yaw * d.y(),
                          -shape.sin_yaw * d.x() + shape.cos_yaw * d.y(),
                          d.z());
  return distance_of(Eigen::Vector3d(q.cwiseAbs() - shape.half_m));
}

bool is_in_leaves(const Shape& shape, const Eigen::Vector3d& p_map_m, double margin_m) {
  const Eigen::Vector3d half_m = shape.half_m.array() + margin_m;
  return shape.kind == Shape::Kind::kFoliage &&
         (p_map_m - shape.centre_m).cwiseQuotient(half_m).squaredNorm() <= 1.0;
}

}  // namespace trigpoint::simulator
