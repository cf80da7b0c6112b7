// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Optional inputs in eskf18: velocity by wheels, heading by magnetometer or two antennas.
#include "trigpoint/base/so3.hpp"

#include "ins_tracker.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kWorstFit = 25.0;       // an outlier speaks for neither heading
constexpr double kMostOfOneTwist = 1.0;  // of log_ratio
constexpr double kMostOfAllYaws = 3.0;   // the same: a wrong one must not outvote the fixes

struct TwistFit {
  Vector3d innovation_mps;
  Matrix3d S_m2ps2;

  double distance2() const { return innovation_mps.dot(S_m2ps2.ldlt().solve(innovation_mps)); }

  double misfit() const {
    return std::min(distance2(), kWorstFit) + S_m2ps2.ldlt().vectorD().array().log().sum();
  }
};

TwistFit fit(const Eskf18& filter,
             const CheckedTwist& twist,
             const Vector3d& point_base_m,
             const Vector3d& gyro_radps) {
  const Jacobian3 H = body_velocity_jacobian(filter, point_base_m);
  return {twist.velocity_base_mps - body_velocity(filter, point_base_m, gyro_radps),
          H * filter.P * H.transpose() + twist.covariance_m2ps2};
}

double misfit(const Eskf18& filter, const Heading& heard) {
  const Jacobian1 H = yaw_jacobian(filter);
  const double S = (H * filter.P * H.transpose()).value() + heard.sigma_rad * heard.sigma_rad;
  const double innovation = wrap_angle(heard.yaw_map_rad - yaw(filter));
  return std::min(innovation * innovation / S, kWorstFit) + std::log(S);
}

}  // namespace

/// While the heading is searched, too: the body's own speed tells forward from reverse.
FixOutcome InsTracker::apply(InsTrack& track, const CheckedTwist& twist) const {
  if (track.phase == Phase::kNoImu ||
      to_seconds(twist.stamp_ns - track.aiding.twist_ns) < config_.twist_interval_s) {
    return {true, "", ""};
  }
  advance(track, twist.stamp_ns);
  track.aiding.twist_ns = twist.stamp_ns;
  const Vector3d& point = config_.twist_point_base_m;
  const Vector3d& gyro = track.imu.gyro_radps;
  const TwistFit mine = fit(track.filter, twist, point, gyro);
  if (track.has_rival) {
    const double gain = 0.5 * (fit(track.rival, twist, point, gyro).misfit() - mine.misfit());
    track.log_ratio += std::clamp(gain, -kMostOfOneTwist, kMostOfOneTwist);
  }
  // Of two headings the better one decides whether the wheels slip.
  const double distance2 =
      track.has_rival ? std::min(mine.distance2(), fit(track.rival, twist, point, gyro).distance2())
                      : mine.distance2();
  if (!passes_gate(track.aiding, twist.stamp_ns, distance2, gate3_)) {
    ++track.twists_refused;
    return {false, "", ""};
  }
  for_each(track, [&](Eskf18& filter) {
    if (fit(filter, twist, point, gyro).distance2() <= gate3_) {
      update_body_velocity(filter, twist.velocity_base_mps, twist.covariance_m2ps2, point, gyro);
    }
  });
  return {true, "", ""};
}

/// Of two headings it speaks for one, once: repeated, a wrong one would outvote the fixes.
void InsTracker::weigh_yaw(InsTrack& track, const Heading& heard) const {
  if (track.has_rival && !track.yaw_weighed) {
    const double gain = 0.5 * (misfit(track.rival, heard) - misfit(track.filter, heard));
    track.log_ratio += std::clamp(gain, -kMostOfAllYaws, kMostOfAllYaws);
    track.yaw_weighed = true;
  }
}

FixOutcome InsTracker::apply(InsTrack& track, const Heading& heard) const {
  AidingState& aiding = track.aiding;
  if (track.phase == Phase::kNoImu ||
      to_seconds(heard.stamp_ns - aiding.yaw_ns) < config_.yaw_interval_s) {
    return {true, "", ""};
  }
  if (heard.stamp_ns < aiding.yaw_distrusted_until_ns) {
    ++track.yaws_refused;
    return {false, "", ""};
  }
  advance(track, heard.stamp_ns);
  aiding.yaw_ns = heard.stamp_ns;
  const double innovation = wrap_angle(heard.yaw_map_rad - yaw(track.filter));
  if (track.phase == Phase::kAligning) {
    aiding.has_prior = true;
    aiding.prior_yaw_map_relative_rad = innovation;
    aiding.prior_sigma_rad = heard.sigma_rad;
    return {true, "", ""};
  }
  weigh_yaw(track, heard);
  const double sigma = filter_yaw_sigma_rad(track);
  if (innovation * innovation > gate_axis_ * (sigma * sigma + heard.sigma_rad * heard.sigma_rad)) {
    ++track.yaws_refused;
    return {false, "", ""};
  }
  // Its errors last: it says no more than its sigma, however often it is said.
  if (sigma > heard.sigma_rad) {
    update_yaw(track.filter, heard.yaw_map_rad, heard.sigma_rad);
    if (sigma > config_.heading_sigma_rad && !aiding.heading_unproven) {
      aiding.heading_unproven = true;
      track.heading.restart();
    }
  }
  return {true, "", ""};
}

CoursePoint InsTracker::course_point(const InsTrack& track, const MapFix& fix) const {
  CoursePoint point;
  point.stamp_ns = fix.checked.stamp_ns;
  point.antenna_map_m = fix.antenna_map_m.head<2>();
  point.sigma_m = std::sqrt(fix.covariance_map_m2.diagonal().head<2>().maxCoeff());
  point.yaw_relative_rad = yaw(track.filter);
  point.lever_relative_m = (track.filter.q_map_base * lever_base_m_).head<2>();
  return point;
}

/// Nothing is frozen on what was heard: motion confirms it, or it and its opposite start anew as
/// rivals and the data decide.
void InsTracker::prove_heading(InsTrack& track, const MapFix& fix) const {
  if (!track.aiding.heading_unproven || track.has_rival) {
    return;
  }
  const auto motion = contradiction(
      track.heading, track.aiding, course_point(track, fix), filter_yaw_sigma_rad(track), config_);
  if (motion) {
    ++track.yaws_contradicted;
    begin_running(track, fix, *motion);
  }
}

}  // namespace trigpoint::gps_odometry
