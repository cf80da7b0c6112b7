// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What fixes do in eskf18: heading from motion with its rival, and the clip gate.
#include "trigpoint/base/so3.hpp"

#include "ins_tracker.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kTeleportMargin_m = 5.0;
constexpr double kOtherReceiver = 2.0;  // ratio of variances that means another kind of solution
constexpr double kDecided = 12.0;       // log of the likelihood ratio
constexpr double kTurnRound = 4.0;      // the same, to exchange filter and rival
constexpr double kWorstFixFit = 25.0;   // a bad fix speaks for neither heading
constexpr double kWrongFix_m = 0.5;     // wrong ambiguities: 15 % of re-fixes, 0.4 to 1.6 m
constexpr double kNothing_m2 = 1e8;     // of a fix that is not used
constexpr double kMostOfOneFix = 1.0;   // of log_ratio: first fits are bad for either heading

/// -2 log of the innovation's density, but for a constant; outliers are cut off.
double misfit(const Vector3d& innovation, const Matrix3d& S) {
  const Eigen::LDLT<Matrix3d> ldlt(S);
  return std::min(innovation.dot(ldlt.solve(innovation)), kWorstFixFit) +
         ldlt.vectorD().array().log().sum();
}

}  // namespace

FixOutcome InsTracker::apply(InsTrack& track, const MapFix& fix) const {
  if (track.phase == Phase::kNoImu) {
    ++track.refused_before_imu;
    return {false, "before_imu", "Fix refused: there is no usable IMU sample yet."};
  }
  advance(track, fix.checked.stamp_ns);
  watch_motion(track, fix);
  watch_scatter(track, fix);
  // A start from another filter's word that the very first fix contradicts was a wrong one.
  const bool wrong = is_unconfirmed(track) && !(judge(track.filter, fix).ratio[kHorizontal] <= 1.0);
  if (track.phase == Phase::kRunning &&
      (wrong || filter_yaw_sigma_rad(track) > config_.heading_lost_rad)) {
    track.phase = Phase::kAligning;
    track.has_rival = false;
    track.heading.restart();
    track.accepted_ns = track.heard_ns = 0;  // whatever the fix says is better than this
  }
  const FixOutcome outcome = track.phase == Phase::kAligning
                                 ? align(track, fix)
                                 : filter_fix(track, as_it_scatters(track, fix));
  keep_on_the_way(track, fix);
  if (outcome.accepted || track.parts[kHorizontal].unsteady) {
    track.heard_ns = fix.checked.stamp_ns;
  }
  return outcome;
}

// ---- heading ------------------------------------------------------------------------------------

FixOutcome InsTracker::refuse_aligning(InsTrack& track, const MapFix& fix, double step_m) const {
  extend(track.refused, fix, config_.highest_speed_mps);
  if (!is_believed(track.refused, config_.recovery_s)) {
    track.refused_ns = fix.checked.stamp_ns;
    ++track.refused_teleport;
    return {false,
            "teleport",
            "Fix refused: it is " + std::to_string(step_m) + " m from the last one."};
  }
  track.heading.restart();
  ++track.recoveries;
  ++track.reset.counter;
  track.reset.delta = {0.0, fix.antenna_map_m - track.accepted_antenna_map_m};
  track.reset_ns = fix.checked.stamp_ns;
  accept(track, fix);
  return {true, "recovered", "Fixes that agree with each other were refused: they are believed."};
}

FixOutcome InsTracker::align(InsTrack& track, const MapFix& fix) const {
  const Vector3d step = fix.antenna_map_m - track.accepted_antenna_map_m;
  const double elapsed_s = to_seconds(fix.checked.stamp_ns - track.accepted_ns);
  const double variance = fix.covariance_map_m2.diagonal().maxCoeff() +
                          track.accepted_covariance_map_m2.diagonal().maxCoeff();
  const double limit_m = config_.highest_speed_mps * std::abs(elapsed_s) + kTeleportMargin_m +
                         5.0 * std::sqrt(variance);
  if (track.accepted_ns > 0 && step.norm() > limit_m) {
    return refuse_aligning(track, fix, step.norm());
  }
  if (track.accepted_ns > 0 && elapsed_s > 0.0) {
    track.speed_mps = step.head<2>().norm() / elapsed_s;
  }
  follow_receiver(track, fix);
  const CoursePoint point = course_point(track, fix);
  auto heading = track.heading.add(point, config_);
  if (!heading && track.accepted_ns > 0) {
    heading = heard_heading(track.aiding, step.head<2>(), elapsed_s, point.sigma_m);
  }
  if (heading) {
    begin_running(track, fix, *heading);
  }
  accept(track, fix);
  return {true, "", ""};
}

/// The course is the heading or its opposite. A strapdown since the last rest knows the body's own
/// velocity, and with it which of the two; if not, both are kept until the data decide.
void InsTracker::begin_running(InsTrack& track,
                               const MapFix& fix,
                               const HeadingEstimate& heading) const {
  const bool searching = track.phase == Phase::kAligning;
  const Vector3d before = searching ? aligning_estimate(track).T_map_base.p : track.filter.p_map_m;
  const double yaw_before = searching ? 0.0 : yaw(track.filter);
  const auto H = body_velocity_jacobian(track.filter, Vector3d::Zero());
  const double own_mps = (track.filter.q_map_base.conjugate() * track.filter.v_map_mps).x();
  const double own_variance = (H * track.filter.P * H.transpose())(0, 0);
  const auto begin = [&](Eskf18& filter, double turn_rad) {
    set_heading(filter, turn_rad, heading.sigma_rad);
    const double course = yaw(track.filter);
    filter.v_map_mps = heading.speed_mps * Vector3d(std::cos(course), std::sin(course), 0.0);
    if (heading.heard) {
      filter.v_map_mps << heading.velocity_map_mps, 0.0;
    }
    reset_block(filter,
                ins::kVelocity,
                heading.speed_sigma_mps * heading.speed_sigma_mps * Matrix3d::Identity());
    filter.p_map_m = fix.antenna_map_m - filter.q_map_base * lever_base_m_;
    filter.fix_error_map_m.setZero();
    const Vector3d slow = config_.eskf18.fix_slow_share * fix.covariance_map_m2.diagonal();
    reset_block(filter, ins::kFixError, slow.asDiagonal());
    // Wide, so that the fix alone says where it is, with all correlations.
    reset_block(filter, ins::kPosition, 100.0 * fix.covariance_map_m2.diagonal().asDiagonal());
    update_fix(filter,
               fix.antenna_map_m,
               config_.eskf18.fix_white_share * fix.covariance_map_m2,
               lever_base_m_);
  };
  begin(track.filter, heading.yaw_map_relative_rad);
  track.rival = track.filter;
  begin(track.rival, kPi);
  const double variance = own_variance + heading.speed_sigma_mps * heading.speed_sigma_mps;
  track.log_ratio =
      std::clamp(2.0 * own_mps * heading.speed_mps / variance, -2.0 * kDecided, 2.0 * kDecided);
  if (heading.heard) {
    track.log_ratio = kDecided;  // it has no opposite; motion must confirm it
  } else if (!searching) {
    track.log_ratio = 0.0;  // the velocity was the fixes', and says nothing about the heading
  }
  if (track.log_ratio < 0.0) {
    std::swap(track.filter, track.rival);
    track.log_ratio = -track.log_ratio;
  }
  track.has_rival = track.log_ratio < kDecided;
  track.phase = Phase::kRunning;
  track.yaw_weighed = false;
  track.heading.restart();
  track.aiding.has_prior = false;
  track.aiding.heading_unproven = heading.heard;
  track.refused = RefusedStreak{};
  track.parts = {};
  if (track.accepted_ns > 0) {
    ++track.reset.counter;
    track.reset.delta = {wrap_angle(yaw(track.filter) - yaw_before), track.filter.p_map_m - before};
    track.reset_ns = fix.checked.stamp_ns;
  }
}

void InsTracker::weigh_rival(InsTrack& track, const MapFix& fix) const {
  if (!track.has_rival) {
    return;
  }
  const Judgement mine = judge(track.filter, fix);
  const Judgement other = judge(track.rival, fix);
  const double gain =
      0.5 * (misfit(other.innovation_m, other.S_m2()) - misfit(mine.innovation_m, mine.S_m2()));
  track.log_ratio += std::clamp(gain, -kMostOfOneFix, kMostOfOneFix);
  if (track.log_ratio < -kTurnRound) {
    const Vector3d before = track.filter.p_map_m;
    std::swap(track.filter, track.rival);
    track.log_ratio = -track.log_ratio;
    ++track.reset.counter;
    track.reset.delta = {kPi, track.filter.p_map_m - before};
    track.reset_ns = fix.checked.stamp_ns;
  }
  track.has_rival = track.log_ratio < kDecided;
}

// ---- fixes --------------------------------------------------------------------------------------

/// Before this fix. Fixes of a receiver that is unsteady are no silence, though they are not used.
double InsTracker::silence_s(const InsTrack& track, const MapFix& fix) {
  return track.heard_ns > 0 ? to_seconds(fix.checked.stamp_ns - track.heard_ns) : 0.0;
}

/// Another kind of solution has another error: what the state has learnt of the old one is gone.
void InsTracker::follow_receiver(InsTrack& track, const MapFix& fix) const {
  const Vector3d now = fix.covariance_map_m2.diagonal();
  const Vector3d last = track.fix_variance_m2;
  const double elapsed_s = silence_s(track, fix);
  const bool changed = (now.array() > kOtherReceiver * last.array()).any() ||
                       (last.array() > kOtherReceiver * now.array()).any();
  const bool silent = elapsed_s > config_.eskf18.suspect_outage_s;
  track.fix_variance_m2 = now;
  const double keep =
      std::exp(-std::clamp(elapsed_s, 0.0, 60.0) / config_.eskf18.better_class_decay_s);
  track.held_variance_m2 = now.cwiseMax(keep * track.held_variance_m2 + (1.0 - keep) * now);
  if (silent && track.phase == Phase::kRunning) {
    // A new solution after an outage: no better than the dead reckoning until it has proven itself.
    const Vector3d known_m2 = track.filter.P.diagonal().segment<3>(ins::kPosition);
    track.held_variance_m2 =
        track.held_variance_m2.cwiseMax(known_m2.cwiseMin(kWrongFix_m * kWrongFix_m));
  }
  if (track.phase != Phase::kRunning) {
    return;
  }
  if (changed) {
    track.scatter = {};
  }
  for (const Part part : kParts) {
    // A receiver that jumped again and again is not believed for having been away.
    if (changed || (silent && !track.parts[part].unsteady)) {
      for_each(track, [&](Eskf18& filter) { renew_fix_error(filter, fix, part); });
      track.parts[part].absorbed_ns = 0;
      track.parts[part].unsteady = false;
    }
  }
}

void InsTracker::renew_fix_error(Eskf18& filter, const MapFix& fix, Part part) const {
  const auto [first, count] = kSpans[part];
  for (int i = first; i < first + count; ++i) {
    filter.fix_error_map_m(i) = 0.0;
    reset_axis(
        filter, ins::kFixError + i, config_.eskf18.fix_slow_share * fix.covariance_map_m2(i, i));
  }
}

InsTracker::Judgement InsTracker::judge(const Eskf18& filter, const MapFix& fix) const {
  const Jacobian3 H = fix_jacobian(filter, lever_base_m_);
  Judgement judgement;
  judgement.innovation_m = fix.antenna_map_m - expected_fix(filter, lever_base_m_);
  judgement.S_filter_m2 = H * filter.P * H.transpose();
  judgement.R_m2 = config_.eskf18.fix_white_share * fix.covariance_map_m2;
  judgement.R_m2.diagonal() += fix.added_white_m2;
  for (const Part part : kParts) {
    judgement.ratio[part] =
        squared_sigmas(judgement.innovation_m, judgement.S_m2(), part) / gate_[part];
  }
  return judgement;
}

/// R such that the innovation lies on the gate: an outlier moves the filter less the farther it is.
void InsTracker::clip(Judgement& judgement, Part part) const {
  const auto [first, count] = kSpans[part];
  const Matrix3d S = judgement.S_m2();
  judgement.R_m2.block(0, 2, 2, 1).setZero();
  judgement.R_m2.block(2, 0, 1, 2).setZero();
  judgement.R_m2.block(first, first, count, count) =
      judgement.ratio[part] * S.block(first, first, count, count) -
      judgement.S_filter_m2.block(first, first, count, count);
}

/// R such that the part says nothing.
void InsTracker::ignore(Judgement& judgement, Part part) {
  const auto [first, count] = kSpans[part];
  judgement.R_m2.block(0, 2, 2, 1).setZero();
  judgement.R_m2.block(2, 0, 1, 2).setZero();
  judgement.R_m2.block(first, first, count, count).setZero();
  judgement.R_m2.diagonal().segment(first, count).setConstant(kNothing_m2);
}

FixOutcome InsTracker::filter_fix(InsTrack& track, const MapFix& fix) const {
  weigh_rival(track, fix);
  follow_receiver(track, fix);
  const auto recoveries = track.recoveries;
  const Vector3d before = track.filter.p_map_m;
  end_absorptions(track, fix);
  Judgement judgement = judge(track.filter, fix);
  for (int i = 0; i < 3; ++i) {
    track.test_ratio[static_cast<std::size_t>(i)] = judgement.innovation_m(i) *
                                                    judgement.innovation_m(i) /
                                                    (gate_axis_ * judgement.S_m2()(i, i));
  }
  hold_doubt(track, fix, judgement);
  std::array<bool, 2> clipped{};
  for (const Part part : kParts) {
    if (track.parts[part].unsteady) {
      clipped[part] = !is_steady_again(track, fix, part);
      judgement = judge(track.filter, fix);
    } else if (judgement.ratio[part] <= 1.0) {
      track.parts[part].streak = RefusedStreak{};
    } else if (resolve(track, fix, part, judgement)) {
      judgement = judge(track.filter, fix);
    } else {
      clipped[part] = true;
    }
  }
  const double innovation_m = judgement.innovation_m.norm();
  const double distance = gate_[kHorizontal] * judgement.ratio[kHorizontal];
  for (const Part part : kParts) {
    if (!clipped[part]) {
      continue;
    }
    // An outlier moves the filter by little, but many of a receiver that is known to be off take
    // its velocity along.
    if (track.parts[part].unsteady || track.parts[part].absorbed_ns > 0) {
      ignore(judgement, part);
    } else {
      clip(judgement, part);
    }
  }
  for_each(track, [&](Eskf18& filter) {
    update_fix(filter, fix.antenna_map_m, judgement.R_m2, lever_base_m_);
  });
  if (track.recoveries != recoveries) {
    ++track.reset.counter;
    track.reset.delta = {0.0, track.filter.p_map_m - before};
    track.reset_ns = fix.checked.stamp_ns;
  }
  if (clipped[kHorizontal]) {
    track.refused_ns = fix.checked.stamp_ns;
    ++track.refused_gate;
    return {false,
            "gate",
            "Fix clipped: it is " + std::to_string(innovation_m) +
                " m from where it should be, its squared Mahalanobis distance " +
                std::to_string(distance) + ", expected at most " +
                std::to_string(gate_[kHorizontal]) + " (2 degrees of freedom)."};
  }
  accept(track, fix);
  prove_heading(track, fix);
  if (clipped[kVertical]) {
    ++track.used_without_height;
    return {true,
            "used_without_height",
            "The fix's height is off by " + std::to_string(judgement.innovation_m.z()) +
                " m; its horizontal part is used."};
  }
  if (track.recoveries != recoveries) {
    return {true, "recovered", "The position is set to fixes that contradicted it for long."};
  }
  return {true, "", ""};
}

void InsTracker::accept(InsTrack& track, const MapFix& fix) const {
  note_accepted(track, fix);
  if (track.phase == Phase::kRunning) {
    const Jacobian3 H = antenna_jacobian(track.filter, lever_base_m_);
    track.accepted_antenna_map_m = antenna(track.filter, lever_base_m_);
    track.accepted_covariance_map_m2 = H * track.filter.P * H.transpose();
    track.accepted_covariance_map_m2.diagonal() += added_variance_m2(track);
    if (track.parts[kHorizontal].absorbed_ns == 0 && fix.checked.stamp_ns < track.moves_until_ns) {
      track.confirmed_speed_mps = std::max(track.confirmed_speed_mps, speed_mps(track));
    }
  } else {
    track.accepted_antenna_map_m = fix.antenna_map_m;
    track.accepted_covariance_map_m2 = fix.covariance_map_m2;
    track.accepted_covariance_map_m2.diagonal() += floor_variance_m2(track, config_);
  }
}

}  // namespace trigpoint::gps_odometry
