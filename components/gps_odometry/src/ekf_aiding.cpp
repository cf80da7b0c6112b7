// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Optional inputs in ekf15: velocity by wheels, heading by magnetometer or two antennas.
#include "trigpoint/base/so3.hpp"

#include "ekf_tracker.hpp"
#include <Eigen/Cholesky>

#include <cmath>

namespace trigpoint::gps_odometry {

using Eigen::Matrix3d;
using Eigen::Vector3d;

FixOutcome EkfTracker::apply(EkfTrack& track, const CheckedTwist& twist) const {
  if (track.phase == Phase::kNoImu ||
      to_seconds(twist.stamp_ns - track.aiding.twist_ns) < config_.twist_interval_s) {
    return {true, "", ""};
  }
  advance(track, twist.stamp_ns);
  track.aiding.twist_ns = twist.stamp_ns;
  Ekf15& filter = track.filter;
  const auto H = point_velocity_jacobian(config_.twist_point_base_m);
  const Vector3d innovation =
      twist.velocity_base_mps - point_velocity(filter.x, config_.twist_point_base_m);
  const Matrix3d S = H * filter.P * H.transpose() + twist.covariance_m2ps2;
  const double distance2 = innovation.dot(S.ldlt().solve(innovation));
  if (!passes_gate(track.aiding, twist.stamp_ns, distance2, gate3_)) {
    ++track.twists_refused;
    return {false, "", ""};
  }
  update_point_velocity(
      filter, twist.velocity_base_mps, twist.covariance_m2ps2, config_.twist_point_base_m);
  return {true, "", ""};
}

FixOutcome EkfTracker::apply(EkfTrack& track, const Heading& yaw) const {
  AidingState& aiding = track.aiding;
  if (track.phase == Phase::kNoImu ||
      to_seconds(yaw.stamp_ns - aiding.yaw_ns) < config_.yaw_interval_s) {
    return {true, "", ""};
  }
  if (yaw.stamp_ns < aiding.yaw_distrusted_until_ns) {
    ++track.yaws_refused;
    return {false, "", ""};
  }
  advance(track, yaw.stamp_ns);
  aiding.yaw_ns = yaw.stamp_ns;
  Ekf15& filter = track.filter;
  const double innovation = wrap_angle(yaw.yaw_map_rad - filter.x(kAttitude + 2));
  if (track.phase == Phase::kAligning) {
    aiding.has_prior = true;
    aiding.prior_yaw_map_relative_rad = innovation;
    aiding.prior_sigma_rad = yaw.sigma_rad;
    return {true, "", ""};
  }
  const double sigma = yaw_sigma_rad(track);
  if (innovation * innovation > gate1_ * (sigma * sigma + yaw.sigma_rad * yaw.sigma_rad)) {
    ++track.yaws_refused;
    return {false, "", ""};
  }
  // Its errors last: it says no more than its sigma, however often it is said.
  if (sigma > yaw.sigma_rad) {
    update_yaw(filter, yaw.yaw_map_rad, yaw.sigma_rad);
    if (sigma > config_.heading_sigma_rad && !aiding.heading_unproven) {
      aiding.heading_unproven = true;
      track.heading.restart();
    }
  }
  return {true, "", ""};
}

CoursePoint EkfTracker::course_point(const EkfTrack& track, const MapFix& fix) const {
  CoursePoint point;
  point.stamp_ns = fix.checked.stamp_ns;
  point.antenna_map_m = fix.antenna_map_m.head<2>();
  point.sigma_m = std::sqrt(fix.covariance_map_m2.diagonal().head<2>().maxCoeff());
  point.yaw_relative_rad = track.filter.x(kAttitude + 2);
  point.lever_relative_m = (track.filter.R_map_base() * lever_base_m_).head<2>();
  return point;
}

/// Nothing is frozen on what was heard: motion confirms it or takes its place.
void EkfTracker::prove_heading(EkfTrack& track, const MapFix& fix) const {
  if (!track.aiding.heading_unproven) {
    return;
  }
  const auto motion = contradiction(
      track.heading, track.aiding, course_point(track, fix), yaw_sigma_rad(track), config_);
  if (motion) {
    ++track.yaws_contradicted;
    begin_running(track, fix, *motion);
  }
}

}  // namespace trigpoint::gps_odometry
