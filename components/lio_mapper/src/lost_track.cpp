// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "lost_track.hpp"

#include "trigpoint/base/so3.hpp"

#include "resumption.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

/// Closer than this the matcher finds the planes by itself.
constexpr double kMatchable_m = 0.5;
constexpr double kMatchable_rad = 0.05;
constexpr double kSigmas = 3.0;
/// Added to what the covariance says.
constexpr double kMargin_m = 1.0;
constexpr double kMargin_rad = 0.05;
/// In so small an area the robot is where the prediction is, if nothing speaks for another place.
constexpr double kSmall_m = 2.0;
/// Grows with the uncertainty up to this many times what a restart searches.
constexpr double kMostRadii = 2.0;

/// Three sigmas in the plane.
double reach_m(const ErrorMatrix& covariance) {
  return kSigmas * std::sqrt(covariance.diagonal().head<2>().maxCoeff());
}

double reach_rad(const ErrorMatrix& covariance) {
  return kSigmas * std::sqrt(covariance.diagonal().segment<3>(error::kRotation).maxCoeff());
}

}  // namespace

PoseSearch LostTrack::search_for(ScanFilter& filter,
                                 const Eigen::Vector3d& lidar_position_base_m,
                                 Nanoseconds scan_ns,
                                 bool doubtful) {
  if (!since_ns_ && (!doubtful || filter.map().empty())) {
    return {};
  }
  return
      [this, &filter, lidar_position_base_m, scan_ns](
          const State& predicted, const ErrorMatrix& covariance, const PointCloud& thinned_base) {
        const bool matchable =
            reach_m(covariance) < kMatchable_m && reach_rad(covariance) < kMatchable_rad;
        predicted_ = predicted.T_odom_base;
        found_.reset();
        if (matchable && !since_ns_) {
          return Sighting{true, std::nullopt, {}};
        }
        if (thinned_base.size() < static_cast<std::size_t>(matching_.min_matches)) {
          obstacle_ = "the sweep has too few points";
          return Sighting{};
        }
        since_ns_ = since_ns_.value_or(scan_ns);
        return search(filter, lidar_position_base_m, predicted, covariance, thinned_base);
      };
}

Sighting LostTrack::search(ScanFilter& filter,
                           const Eigen::Vector3d& lidar_position_base_m,
                           const State& predicted,
                           const ErrorMatrix& covariance,
                           const PointCloud& thinned_base) {
  const Pose& T = predicted.T_odom_base;
  const LevelScan scan{
      thinned_base, (from_yaw(-yaw_of(T.q)) * T.q).normalized(), lidar_position_base_m};
  SearchArea area{{T},
                  std::min(kMargin_m + reach_m(covariance), kMostRadii * config_.radius_m),
                  std::min(kMargin_rad + reach_rad(covariance), config_.yaw_rad)};
  area.holds_robot =
      area.radius_m < kSmall_m && kMargin_rad + reach_rad(covariance) <= config_.yaw_rad;
  area.sigma_m = reach_m(covariance) / kSigmas;
  const RegistrationResult result =
      register_scan(scan, filter.map(), area, matching_, config_, filter.workers());
  obstacle_ = result.obstacle;
  if (!result.accepted) {
    return {};
  }
  found_ = result.best;
  return {false, found_->T_odom_base, found_->spread_m2};
}

std::optional<Event> LostTrack::conclude(const ScanOutcome& outcome, Nanoseconds scan_ns) {
  if (!since_ns_) {
    return std::nullopt;
  }
  if (!found_ || !outcome.used) {
    return Event{Severity::kWarning,
                 scan_ns,
                 "lio_searching",
                 "the scan was not found in the map around the prediction: " + obstacle_};
  }
  since_ns_.reset();
  const Pose moved = found_->T_odom_base * predicted_.inverse();
  delta_.yaw_rad = yaw_of(moved.q);
  delta_.p = found_->T_odom_base.p - from_yaw(delta_.yaw_rad) * predicted_.p;
  return Event{Severity::kInfo,
               scan_ns,
               "lio_recovered",
               "the track is found again, " + offset_text(predicted_, found_->T_odom_base)};
}

bool LostTrack::must_begin_anew(Nanoseconds scan_ns) const {
  return since_ns_ && to_seconds(scan_ns - *since_ns_) > config_.give_up_s;
}

}  // namespace trigpoint::lio_mapper
