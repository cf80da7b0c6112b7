// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <string>

namespace trigpoint::fusion_gate {

/// What is trusted or doubted together: reflections that spoil one horizontal axis spoil the other.
enum class Part : std::size_t { kLevel, kHeight };

inline constexpr std::array<Part, 2> kParts{Part::kLevel, Part::kHeight};

inline constexpr std::size_t index_of(Part part) {
  return static_cast<std::size_t>(part);
}

/// Of an axis of map.
inline constexpr Part part_of(int axis) {
  return axis < 2 ? Part::kLevel : Part::kHeight;
}

inline constexpr double kUnbrokenGap_s = 2.0;  // a longer silence confirms nothing

/// The antenna at a fix's stamp, as GPS and as LIO saw it.
struct Sighting {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d gps_map_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gps_variance_m2{Eigen::Vector3d::Ones()};
  Eigen::Vector3d lio_odom_m{Eigen::Vector3d::Zero()};
  double distance_m{0.0};  ///< driven
  Eigen::Vector3d blind_m{
      Eigen::Vector3d::Zero()};  ///< of it, while LIO was blind along odom's axes
  std::array<bool, 2> used{};    ///< by part
};

}  // namespace trigpoint::fusion_gate
