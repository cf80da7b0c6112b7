// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "place_checks.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

// Geoid undulations that matter (research/gps C2); the Earth's lie between -107 and 86 m.
constexpr double kLeastUndulation_m = 10.0;
constexpr double kLargestUndulation_m = 110.0;
constexpr double kNearDatum_m = 300.0;
constexpr double kSteepest = 0.3;  // hills are not undulations
constexpr int kFixes = 10;
constexpr double kOnePlace_m = 5.0;
constexpr Nanoseconds kOneMoment_ns = 2 * kNanosecondsPerSecond;
constexpr std::size_t kMostFrames = 16;  // names come from outside

bool can_be_undulation(double height_m) {
  return std::abs(height_m) > kLeastUndulation_m && std::abs(height_m) < kLargestUndulation_m;
}

}  // namespace

DistanceVerdict DatumDistance::check(const Eigen::Vector3d& position_map_m) {
  const double distance_m = position_map_m.head<2>().norm();
  was_near_ = was_near_ || distance_m <= highest_m_;
  if (!was_near_ || !std::isfinite(distance_m)) {
    return {true,
            "Fix refused: it is " + std::to_string(distance_m * 1e-3) +
                " km from the datum, expected at most " + std::to_string(highest_m_ * 1e-3) +
                "; is a sign or the order of latitude and longitude wrong, or the datum another "
                "place's?"};
  }
  const bool crossed = distance_m > warn_m_ && !warned_;
  // Half of it, so that a drive along the border warns once.
  warned_ = warned_ ? distance_m > 0.5 * warn_m_ : crossed;
  if (!crossed) {
    return {};
  }
  return {false,
          "Fixes are " + std::to_string(distance_m) + " m from the datum: map's z axis leans by " +
              std::to_string(distance_m / 111'200.0) + " degrees there. A nearer datum is better."};
}

std::optional<std::string> HeightReference::check(Nanoseconds stamp_ns,
                                                  const Eigen::Vector3d& position_map_m) {
  const Eigen::Vector3d last = last_map_m_.value_or(position_map_m);
  const bool one_place = (position_map_m - last).head<2>().norm() < kOnePlace_m &&
                         std::abs(stamp_ns - last_ns_) < kOneMoment_ns;
  const double step_m = position_map_m.z() - last.z();
  last_map_m_ = position_map_m;
  last_ns_ = stamp_ns;
  const double distance_m = position_map_m.head<2>().norm();
  const double beyond_hills_m = std::abs(position_map_m.z()) - kSteepest * distance_m;
  const bool off = distance_m < kNearDatum_m && can_be_undulation(position_map_m.z()) &&
                   beyond_hills_m > kLeastUndulation_m;
  off_datum_ = off ? off_datum_ + 1 : 0;
  if (told_ || (!(one_place && can_be_undulation(step_m)) && off_datum_ < kFixes)) {
    return std::nullopt;
  }
  told_ = true;
  return off_datum_ < kFixes
             ? "The height of fixes changed by " + std::to_string(step_m) +
                   " m at one place: another height reference (ellipsoid or sea)?"
             : "Fixes near the datum are " + std::to_string(position_map_m.z()) +
                   " m above it: is one of them above the sea and not above the ellipsoid? See "
                   "robot.geoid_undulation_m.";
}

bool FrameIds::allows(const std::string& frame_id) const {
  return allowed_.empty() ||
         std::find(allowed_.begin(), allowed_.end(), frame_id) != allowed_.end();
}

bool FrameIds::is_news(const std::string& frame_id) {
  return told_.size() < kMostFrames && told_.insert(frame_id).second;
}

std::string FrameIds::text(const std::string& frame_id) const {
  std::string expected;
  for (const std::string& allowed : allowed_) {
    expected += (expected.empty() ? "'" : ", '") + allowed + "'";
  }
  return "Messages in frame '" + frame_id + "' are refused, expected " + expected + ".";
}

}  // namespace trigpoint::gps_odometry
