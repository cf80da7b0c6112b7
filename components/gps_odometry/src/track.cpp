// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "track.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Vector3d;

constexpr int kRecoveryFixes = 4;
constexpr double kRecoveryGap_s = 5.0;  // refused fixes further apart are not one streak

bool agrees(const RefusedStreak& streak, const MapFix& fix, double highest_speed_mps) {
  const double elapsed_s = to_seconds(fix.checked.stamp_ns - streak.last_ns);
  const double sigma = std::sqrt(fix.covariance_map_m2.diagonal().maxCoeff());
  const double step = (fix.antenna_map_m - streak.last_map_m).norm();
  return elapsed_s >= 0.0 && elapsed_s < kRecoveryGap_s &&
         step < highest_speed_mps * elapsed_s + 5.0 * sigma;
}

}  // namespace

FixRecord record_of(Nanoseconds stamp_ns, const FixOutcome& outcome, const Track& after) {
  FixRecord record;
  record.stamp_ns = stamp_ns;
  record.accepted = outcome.accepted;
  record.reason = outcome.accepted ? "" : outcome.reason;
  if (outcome.accepted) {
    record.antenna_map_m = after.accepted_antenna_map_m;
    record.covariance_map_m2 = after.accepted_covariance_map_m2;
  }
  return record;
}

void extend(RefusedStreak& streak, const MapFix& fix, double highest_speed_mps) {
  if (streak.count == 0 || !agrees(streak, fix, highest_speed_mps)) {
    streak = RefusedStreak{0, fix.checked.stamp_ns, 0, Vector3d::Zero()};
  }
  ++streak.count;
  streak.last_ns = fix.checked.stamp_ns;
  streak.last_map_m = fix.antenna_map_m;
}

bool is_believed(const RefusedStreak& streak, double recovery_s) {
  return streak.count >= kRecoveryFixes &&
         to_seconds(streak.last_ns - streak.first_ns) >= recovery_s;
}

void note_accepted(Track& track, const MapFix& fix) {
  const double elapsed_s =
      track.accepted_ns > 0 ? to_seconds(fix.checked.stamp_ns - track.accepted_ns) : 0.0;
  if (elapsed_s > 0.0) {
    const double interval = std::min(elapsed_s, 2.0);
    track.fix_interval_s =
        track.fix_interval_s == 0.0 ? interval : 0.8 * track.fix_interval_s + 0.2 * interval;
  }
  ++track.accepted;
  track.refused = RefusedStreak{};
  track.accepted_ns = fix.checked.stamp_ns;
  track.gnss_class = fix.checked.gnss_class;
  track.assumed_covariance = fix.checked.assumed_covariance;
}

Vector3d floor_variance_m2(const Track& track, const Config& config) {
  const double sigma = track.gnss_class == GnssClass::kFixed ? config.floor_sigma_fixed_m
                                                             : config.floor_sigma_other_m;
  return Vector3d(sigma, sigma, 2.0 * sigma).cwiseAbs2();
}

void forget_velocity(Estimate& estimate) {
  estimate.twist_covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * kUnknownVariance;
  estimate.twist_covariance.topRightCorner<3, 3>().setZero();
  estimate.twist_covariance.bottomLeftCorner<3, 3>().setZero();
}

}  // namespace trigpoint::gps_odometry
