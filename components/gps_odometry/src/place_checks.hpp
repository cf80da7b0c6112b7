// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Fixes against the datum: how far is too far, and whose heights are they? And whose messages.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <Eigen/Core>

#include <optional>
#include <set>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {

struct DistanceVerdict {
  bool refused{false};
  std::string text;  ///< of a refusal, or of a warning: once each time the distance is crossed
};

/// A tangent plane is not a map of a country: far from the datum its z axis is not up any more. Too
/// far is refused only until one fix was near: a datum that is a mistake (a sign, another place's)
/// shows at the start, and a drive may lead far away from where its map begins.
class DatumDistance {
 public:
  explicit DatumDistance(const Config& config)
      : warn_m_(config.warn_distance_m), highest_m_(config.highest_distance_m) {}

  DistanceVerdict check(const Eigen::Vector3d& position_map_m);

 private:
  double warn_m_;
  double highest_m_;
  bool warned_{false};
  bool was_near_{false};
};

/// Heights above the ellipsoid and above the sea differ by 10 to 110 m in most places. A sentence,
/// once, when fixes near the datum differ from it by so much, or change by it at one place.
class HeightReference {
 public:
  std::optional<std::string> check(Nanoseconds stamp_ns, const Eigen::Vector3d& position_map_m);

 private:
  std::optional<Eigen::Vector3d> last_map_m_;
  Nanoseconds last_ns_{0};
  int off_datum_{0};
  bool told_{false};
};

/// Frames in which messages may be; an unknown one is told once.
class FrameIds {
 public:
  explicit FrameIds(std::vector<std::string> allowed) : allowed_(std::move(allowed)) {}

  bool allows(const std::string& frame_id) const;
  /// True the first time that this frame is refused.
  bool is_news(const std::string& frame_id);
  std::string text(const std::string& frame_id) const;

 private:
  std::vector<std::string> allowed_;
  std::set<std::string> told_;
};

}  // namespace trigpoint::gps_odometry
