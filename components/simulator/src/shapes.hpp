// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the world is made of, and where a ray meets it.
// Reference: [1] C. Ericson, "Real-time collision detection", 2005, sec. 5.3.3 (slabs), 5.3.7
// (cylinder).
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <limits>

namespace trigpoint::simulator {

struct Ray {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;  ///< unit
  std::uint64_t key{0};       ///< decides what is random in the world along this ray (foliage)
};

struct Hit {
  double range_m{std::numeric_limits<double>::infinity()};
  double cos_incidence{1.0};  ///< in (0, 1]
  double reflectivity{0.0};   ///< 0 to 1

  bool is_hit() const { return range_m < std::numeric_limits<double>::infinity(); }
};

/// A box turned about z, an upright cylinder, or an ellipsoid filled with leaves.
struct Shape {
  enum class Kind : std::uint8_t { kBox, kCylinder, kFoliage };

  Kind kind{Kind::kBox};
  Eigen::Vector3d centre_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d half_m{Eigen::Vector3d::Zero()};  ///< half sizes; radius in x and y
  double cos_yaw{1.0};
  double sin_yaw{0.0};
  double reflectivity{0.4};
  double free_path_m{1.0};  ///< mean distance that light travels through leaves

  /// Half sizes of the box along the axes of map that holds the shape.
  Eigen::Vector3d half_extent_m() const;
};

/// Shortens `hit` if the ray meets the shape nearer than that. `index` tells shapes apart for what
/// is random along the ray.
void intersect(const Shape& shape, std::uint64_t index, const Ray& ray, Hit& hit);

}  // namespace trigpoint::simulator
