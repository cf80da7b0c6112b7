// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "shapes.hpp"

#include "random.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kNearest_m = 1e-3;
constexpr double kSteepest = 0.02;  ///< smallest cosine of incidence reported

void shorten(Hit& hit, double range_m, double cosine, double reflectivity) {
  if (range_m > kNearest_m && range_m < hit.range_m) {
    hit = {range_m, std::clamp(std::abs(cosine), kSteepest, 1.0), reflectivity};
  }
}

void intersect_box(const Shape& box, const Ray& ray, Hit& hit) {
  const Eigen::Vector3d o = ray.origin_m - box.centre_m;
  const Eigen::Vector3d& d = ray.direction;
  const Eigen::Vector3d p(
      box.cos_yaw * o.x() + box.sin_yaw * o.y(), -box.sin_yaw * o.x() + box.cos_yaw * o.y(), o.z());
  const Eigen::Vector3d u(
      box.cos_yaw * d.x() + box.sin_yaw * d.y(), -box.sin_yaw * d.x() + box.cos_yaw * d.y(), d.z());
  double enter = -std::numeric_limits<double>::infinity();
  double leave = hit.range_m;
  int face = 0;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(u[i]) < 1e-12) {
      if (std::abs(p[i]) > box.half_m[i]) {
        return;
      }
      continue;
    }
    const double a = (-box.half_m[i] - p[i]) / u[i];
    const double b = (box.half_m[i] - p[i]) / u[i];
    if (std::min(a, b) > enter) {
      enter = std::min(a, b);
      face = i;
    }
    leave = std::min(leave, std::max(a, b));
  }
  if (enter <= leave) {
    shorten(hit, enter, u[face], box.reflectivity);
  }
}

void intersect_cylinder(const Shape& cylinder, const Ray& ray, Hit& hit) {
  const Eigen::Vector3d p = ray.origin_m - cylinder.centre_m;
  const Eigen::Vector3d& u = ray.direction;
  const double r = cylinder.half_m.x();
  const double a = u.x() * u.x() + u.y() * u.y();
  const double b = p.x() * u.x() + p.y() * u.y();
  const double c = p.x() * p.x() + p.y() * p.y() - r * r;
  const double discriminant = b * b - a * c;
  if (a < 1e-12 || discriminant < 0.0) {
    return;
  }
  const double t = (-b - std::sqrt(discriminant)) / a;
  if (std::abs(p.z() + t * u.z()) <= cylinder.half_m.z()) {
    shorten(hit, t, std::sqrt(discriminant) / r, cylinder.reflectivity);
  }
}

/// Leaves stop light anywhere in the crown: the depth is exponential, and some light passes
/// through.
void intersect_foliage(const Shape& crown, std::uint64_t index, const Ray& ray, Hit& hit) {
  const Eigen::Vector3d p = (ray.origin_m - crown.centre_m).cwiseQuotient(crown.half_m);
  const Eigen::Vector3d u = ray.direction.cwiseQuotient(crown.half_m);
  const double a = u.squaredNorm();
  const double b = p.dot(u);
  const double discriminant = b * b - a * (p.squaredNorm() - 1.0);
  if (discriminant < 0.0) {
    return;
  }
  const double enter = std::max(0.0, (-b - std::sqrt(discriminant)) / a);
  const double leave = (-b + std::sqrt(discriminant)) / a;
  if (enter > leave || enter > hit.range_m) {
    return;
  }
  Random random(derive_seed(ray.key, index));
  const double stop = enter - crown.free_path_m * std::log(1.0 - random.uniform());
  if (stop < leave) {
    shorten(hit, stop, random.uniform(0.4, 1.0), crown.reflectivity);
  }
}

}  // namespace

Eigen::Vector3d Shape::half_extent_m() const {
  if (kind != Kind::kBox) {
    return half_m;
  }
  const double c = std::abs(cos_yaw);
  const double s = std::abs(sin_yaw);
  return {c * half_m.x() + s * half_m.y(), s * half_m.x() + c * half_m.y(), half_m.z()};
}

void intersect(const Shape& shape, std::uint64_t index, const Ray& ray, Hit& hit) {
  switch (shape.kind) {
    case Shape::Kind::kBox:
      return intersect_box(shape, ray, hit);
    case Shape::Kind::kCylinder:
      return intersect_cylinder(shape, ray, hit);
    case Shape::Kind::kFoliage:
      return intersect_foliage(shape, index, ray, hit);
  }
}

}  // namespace trigpoint::simulator
