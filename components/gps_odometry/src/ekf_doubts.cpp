// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What ekf15 cannot have in its states, for it has neither biases nor errors of the fixes: the
// accelerometer's error along gravity, found at rest, and what is added to the published variance.
#include "ekf_tracker.hpp"
#include "gravity.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Vector3d;

// Rest, as for the gyro's bias (research/gps C5).
constexpr double kEkfRestSpeed_mps = 0.3;
constexpr double kEkfRestRate_radps = 0.03;
constexpr double kMostUpError_mps2 = 0.3;

// The same sizes as eskf18's.
constexpr double kDoubtHold_s = 30.0;
constexpr double kDoubtDecay_s = 5.0;  // after that
constexpr double kBetterClassDecay_s = 20.0;
constexpr double kEkfWrongFix_m = 0.5;      // wrong ambiguities: 15 % of re-fixes, 0.4 to 1.6 m
constexpr double kEkfReadmission_m = 10.0;  // step after an outage that is doubted
constexpr double kOutage_s = 3.0;   // without fixes, after which the receiver is another one
constexpr int kContradictions = 2;  // refused fixes that are more than a spike
// More says no more, and beside variances of 1e-4 m^2 the matrix would lose its small eigenvalues
// to rounding (1e12 times 2e-16 is 2e-4).
constexpr double kMostDoubt_m2 = kUnknownVariance;

/// What is left of the doubt at the track's time: 1 while it is held.
double doubt_left(const EkfTrack& track) {
  const double over_s = std::max(0.0, to_seconds(track.stamp_ns - track.doubt_until_ns));
  return std::exp(-over_s / kDoubtDecay_s);
}

void raise_doubt(EkfTrack& track, const Vector3d& step_m, Nanoseconds stamp_ns) {
  track.doubt_m2 =
      (doubt_left(track) * track.doubt_m2).cwiseMax(step_m.cwiseAbs2()).cwiseMin(kMostDoubt_m2);
  track.doubt_until_ns = stamp_ns + from_seconds(kDoubtHold_s);
}

}  // namespace

// ---- at rest -----------------------------------------------------------------------------------

/// At rest the accelerometer measures gravity: what it measures too much would be taken for a
/// climb. Of the other axes it would tell tilt and bias together.
void EkfTracker::learn_at_rest(EkfTrack& track, const QuietWindow& quiet) const {
  const bool is_slow = track.accepted_ns == 0 || speed_mps(track) < kEkfRestSpeed_mps;
  const double up_mps2 = quiet.mean_accel_mps2.norm() - kGravity_mps2;
  if (is_slow && quiet.mean_gyro_radps.norm() < kEkfRestRate_radps &&
      std::abs(up_mps2) < kMostUpError_mps2) {
    track.up_error_mps2 = up_mps2;
    track.knows_up_error = true;
  }
}

// ---- contradictions that end with following the fixes -------------------------------------------

/// A large step after an outage may be the filter's drift or the receiver's error.
void EkfTracker::doubt_step(EkfTrack& track, const MapFix& fix) const {
  const double age_s = to_seconds(fix.checked.stamp_ns - track.accepted_ns);
  const Vector3d step = fix.antenna_map_m - expected_antenna(track.filter.x, lever_base_m_);
  const double least_m =
      kEkfReadmission_m + 3.0 * std::sqrt(fix.covariance_map_m2.diagonal().maxCoeff());
  // Before the first accepted fix nothing but another filter's word is contradicted.
  if (track.accepted_ns > 0 && age_s > kOutage_s && step.norm() > least_m) {
    raise_doubt(track, step, fix.checked.stamp_ns);
  }
}

/// Whether a fix that passes the gate is one of those that were refused before: nearer to them than
/// to the filter. Otherwise the receiver has come back and the filter was right.
bool EkfTracker::follows_refused(const EkfTrack& track, const Vector3d& innovation_m) const {
  return track.refused.count >= kContradictions &&
         (innovation_m - track.refused_innovation_m).head<2>().norm() <
             innovation_m.head<2>().norm();
}

/// Fixes were refused until the filter's sigma had grown enough to let one pass. That proves
/// nothing: the step is announced and doubted, and it tells nothing of the velocity.
void EkfTracker::readmit(EkfTrack& track, const MapFix& fix, bool with_height) const {
  Ekf15& filter = track.filter;
  Vector3d step = fix.antenna_map_m - expected_antenna(filter.x, lever_base_m_);
  const int axes = with_height ? 3 : 2;
  if (!with_height) {
    step.z() = 0.0;
  }
  filter.x.segment<3>(kPosition) += step;
  filter.P.middleRows(kPosition, axes).setZero();
  filter.P.middleCols(kPosition, axes).setZero();
  filter.P.block(kPosition, kPosition, axes, axes) =
      fix.covariance_map_m2.topLeftCorner(axes, axes);
  raise_doubt(track, step, fix.checked.stamp_ns);
  ++track.reset.counter;
  track.reset.delta = {0.0, step};
  track.reset_ns = fix.checked.stamp_ns;
}

void EkfTracker::recover(EkfTrack& track, const MapFix& fix) const {
  const Vector3d before = pose(track).p;
  if (track.phase == Phase::kRunning) {
    Ekf15& filter = track.filter;
    const Vector3d innovation = fix.antenna_map_m - expected_antenna(filter.x, lever_base_m_);
    filter.x.segment<3>(kPosition) += innovation;
    reset_block(filter, kPosition, fix.covariance_map_m2);
    const Eigen::Matrix3d P_velocity =
        filter.P.block<3, 3>(kVelocity, kVelocity) + Eigen::Matrix3d::Identity() * 4.0;
    reset_block(filter, kVelocity, P_velocity);
    // A position that had to be set may have been lost because of the heading.
    filter.P(kAttitude + 2, kAttitude + 2) += 0.25;
    // Who was right is open: the published sigma remembers the disagreement for a while.
    raise_doubt(track, innovation, fix.checked.stamp_ns);
  } else {
    track.heading.restart();
  }
  ++track.recoveries;
  track.refused_height = RefusedStreak{};
  track.accepted_ns = fix.checked.stamp_ns;  // what was just raised must not decay at once
  accept(track, fix);
  ++track.reset.counter;
  track.reset.delta = {0.0, pose(track).p - before};
  track.reset_ns = fix.checked.stamp_ns;
}

void EkfTracker::recover_height(EkfTrack& track, const MapFix& fix) const {
  Ekf15& filter = track.filter;
  const double innovation = fix.antenna_map_m.z() - expected_antenna(filter.x, lever_base_m_).z();
  for (const int i : {kPosition + 2, kVelocity + 2}) {
    const double variance = i == kPosition + 2 ? fix.covariance_map_m2(2, 2) : filter.P(i, i) + 1.0;
    filter.P.row(i).setZero();
    filter.P.col(i).setZero();
    filter.P(i, i) = variance;
  }
  filter.x(kPosition + 2) += innovation;
  raise_doubt(track, {0.0, 0.0, innovation}, fix.checked.stamp_ns);
  track.refused_height = RefusedStreak{};
  ++track.recoveries;
  ++track.reset.counter;
  track.reset.delta = {0.0, Vector3d(0.0, 0.0, innovation)};
  track.reset_ns = fix.checked.stamp_ns;
}

// ---- what is added to the published variance ----------------------------------------------------

/// Peak hold: rises at once, falls with the decay time.
void EkfTracker::hold_correlated(EkfTrack& track, const MapFix& fix, double elapsed_s) const {
  const Vector3d now = config_.fix_correlated_share * fix.covariance_map_m2.diagonal();
  const double keep = std::exp(-std::clamp(elapsed_s, 0.0, 60.0) / config_.correlated_decay_s);
  track.correlated_m2 = now.cwiseMax(keep * track.correlated_m2 + (1.0 - keep) * now);
}

/// The same of all that the receiver reports, and of a metre's half after an outage: nothing shows
/// that a solution which has just become better is right.
void EkfTracker::hold_reported(EkfTrack& track, const MapFix& fix, double elapsed_s) const {
  const Vector3d now = fix.covariance_map_m2.diagonal();
  const double keep = std::exp(-std::clamp(elapsed_s, 0.0, 60.0) / kBetterClassDecay_s);
  track.held_m2 = now.cwiseMax(keep * track.held_m2 + (1.0 - keep) * now);
  if (elapsed_s > kOutage_s && track.phase == Phase::kRunning) {
    track.held_m2 = track.held_m2.cwiseMax(Vector3d::Constant(kEkfWrongFix_m * kEkfWrongFix_m));
  }
  track.fix_m2 = now;
}

/// What the filter cannot know of its own error.
Vector3d EkfTracker::added_variance_m2(const EkfTrack& track) const {
  return track.correlated_m2 + (track.held_m2 - track.fix_m2).cwiseMax(0.0) +
         doubt_left(track) * track.doubt_m2 + floor_variance_m2(track, config_);
}

}  // namespace trigpoint::gps_odometry
