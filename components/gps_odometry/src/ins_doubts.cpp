// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Who is wrong when fixes contradict eskf18: the filter, the receiver once, or a receiver whose
// steps say nothing.
#include "ins_tracker.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kReadmission_m = 10.0;  // step after an outage that is remembered
constexpr double kLostSpeed_mps = 2.0;   // doubts after the position had to be set
constexpr double kLostYaw_rad = 0.5;
constexpr double kStillAbsorbed = 3.0;  // sigmas of the class
constexpr double kStuckLimits = 5.0;    // times absorb_limit_s, before a stuck receiver is believed
constexpr double kFaster = 1.5;         // than fixes confirmed: a strapdown that is wrong
constexpr double kSteady_s = 10.0;      // a receiver that jumps again sooner does not hold still

}  // namespace

double squared_sigmas(const Vector3d& innovation_m, const Matrix3d& S_m2, Part part) {
  const auto [first, count] = kSpans[part];
  const Eigen::VectorXd nu = innovation_m.segment(first, count);
  return nu.dot(S_m2.block(first, first, count, count).ldlt().solve(nu));
}

/// A step after an outage that the filter's own sigma does not explain: who was wrong is open, and
/// what is beyond that sigma is remembered when large. A step within it is no evidence against the
/// fix, however far the dead reckoning had gone.
void InsTracker::hold_doubt(InsTrack& track, const MapFix& fix, const Judgement& judgement) const {
  if (silence_s(track, fix) <= config_.eskf18.suspect_outage_s) {
    return;
  }
  for (const Part part : kParts) {
    if (judgement.ratio[part] <= 1.0 || track.parts[part].unsteady) {
      continue;
    }
    const auto [first, count] = kSpans[part];
    const Vector3d variance_m2 = fix.covariance_map_m2.diagonal();
    const double least_m =
        kReadmission_m + 3.0 * std::sqrt(variance_m2.segment(first, count).maxCoeff());
    if (judgement.innovation_m.segment(first, count).norm() <= least_m) {
      continue;
    }
    for (int i = first; i < first + count; ++i) {
      const double excess_m2 =
          judgement.innovation_m(i) * judgement.innovation_m(i) - judgement.S_m2()(i, i);
      track.doubt_m(i) = std::max(track.doubt_m(i), std::sqrt(std::max(0.0, excess_m2)));
    }
    track.doubt_until_ns = fix.checked.stamp_ns + from_seconds(config_.eskf18.doubt_hold_s);
  }
}

/// The receiver, whose error state holds a jump, is where the filter is: the filter was right.
bool InsTracker::has_come_back(InsTrack& track, const MapFix& fix, Part part) const {
  Eskf18 fresh = track.filter;
  renew_fix_error(fresh, fix, part);
  if (judge(fresh, fix).ratio[part] > 1.0) {
    return false;
  }
  for_each(track, [&](Eskf18& filter) { renew_fix_error(filter, fix, part); });
  track.parts[part] = Contradiction{};
  const auto [first, count] = kSpans[part];
  track.doubt_m.segment(first, count).setZero();
  return true;
}

/// Stuck is who stands where the strapdown, by its own sigma, cannot. A robot at rest whose
/// accelerometer is wrong does not shake, or is soon faster than moving fixes ever confirmed.
void InsTracker::note_stuck(InsTrack& track, const MapFix& fix, Part part) const {
  Contradiction& contradiction = track.parts[part];
  contradiction.runs_away =
      contradiction.runs_away || speed_mps(track) > kFaster * track.confirmed_speed_mps;
  if (track.quiet_ns < contradiction.steady_ns && !contradiction.runs_away) {
    contradiction.stuck_ns = fix.checked.stamp_ns;
  }
}

/// Of a receiver that jumped again and again: true when its fixes went where the strapdown went for
/// long enough without a silence. Then the filter was right, or they hold still at another place.
bool InsTracker::is_steady_again(InsTrack& track, const MapFix& fix, Part part) const {
  Contradiction& contradiction = track.parts[part];
  const auto [first, count] = kSpans[part];
  const Vector3d off_m = fix.antenna_map_m - antenna(track.filter, lever_base_m_);
  const double passed_s = to_seconds(fix.checked.stamp_ns - contradiction.steady_ns);
  const Matrix3d fixes_m2 =
      2.0 * (fix.covariance_map_m2 + Matrix3d(fix.added_white_m2.asDiagonal()));
  const Matrix3d way_m2 =
      passed_s * passed_s * track.filter.P.block<3, 3>(ins::kVelocity, ins::kVelocity);
  const Vector3d unlike_m = off_m - contradiction.steady_off_m;
  const Vector3d moved_m = fix.antenna_map_m - contradiction.steady_fix_map_m;
  const bool stands = squared_sigmas(moved_m, fixes_m2, part) <= gate_[part];
  if (contradiction.steady_ns != 0 && stands &&
      squared_sigmas(moved_m - unlike_m, fixes_m2 + way_m2, part) > gate_[part]) {
    note_stuck(track, fix, part);
  }
  const bool was_away = silence_s(track, fix) > config_.eskf18.suspect_outage_s;
  if (contradiction.steady_ns == 0 || was_away ||
      squared_sigmas(unlike_m, fixes_m2 + way_m2, part) > gate_[part]) {
    contradiction.steady_ns = fix.checked.stamp_ns;
    contradiction.steady_fix_map_m = fix.antenna_map_m;
    contradiction.steady_off_m = off_m;
    return false;
  }
  // A strapdown that has become uncertain may allow for it, but fixes that stand still while it
  // moves are stuck and not steady.
  if (stands && squared_sigmas(moved_m - unlike_m, fixes_m2, part) > gate_[part]) {
    return false;
  }
  if (passed_s < config_.recovery_s) {
    return false;
  }
  // What it says now is not proven either: a later step within what was not known is a correction.
  const Vector3d known_m2 = track.filter.P.diagonal().segment<3>(ins::kPosition);
  auto held_m2 = track.held_variance_m2.segment(first, count);
  held_m2 = held_m2.cwiseMax(known_m2.segment(first, count)).eval();
  if (!has_come_back(track, fix, part)) {
    contradiction.unsteady = false;
    contradiction.absorbed_ns = contradiction.jumped_ns = fix.checked.stamp_ns;
    for_each(track, [&](Eskf18& filter) {
      renew_fix_error(filter, fix, part);
      filter.fix_error_map_m.segment(first, count) = off_m.segment(first, count);
    });
    track.doubt_m.segment(first, count) =
        track.doubt_m.segment(first, count).cwiseMax(0.5 * off_m.segment(first, count).cwiseAbs());
  }
  return true;
}

/// Whether the IMU stood at the end of its range: it is the strapdown then that went another way.
bool InsTracker::has_guessed(const InsTrack& track, Nanoseconds stamp_ns) const {
  return track.saturated_ns > 0 &&
         to_seconds(stamp_ns - track.saturated_ns) < config_.eskf18.doubt_hold_s;
}

/// True when the contradiction was explained, and the fix is to be judged anew.
bool InsTracker::resolve(InsTrack& track,
                         const MapFix& fix,
                         Part part,
                         const Judgement& judgement) const {
  Contradiction& contradiction = track.parts[part];
  if (contradiction.absorbed_ns > 0 && has_come_back(track, fix, part)) {
    return true;
  }
  if (was_unproven(track, fix, part, judgement)) {
    return true;
  }
  extend(contradiction.streak, fix, config_.highest_speed_mps);
  if (contradiction.streak.count == 1) {
    contradiction.filter_is_suspect =
        track.heard_ns == 0 || silence_s(track, fix) > config_.eskf18.suspect_outage_s ||
        fix.checked.stamp_ns < track.doubt_until_ns || has_guessed(track, fix.checked.stamp_ns);
  }
  if (contradiction.filter_is_suspect) {
    if (is_believed(contradiction.streak, config_.recovery_s)) {
      recover(track, fix, part);
      return true;
    }
    return false;
  }
  if (contradiction.streak.count >= config_.eskf18.absorb_fixes) {
    if (contradiction.absorbed_ns > 0 &&
        to_seconds(contradiction.streak.first_ns - contradiction.jumped_ns) < kSteady_s) {
      contradiction.unsteady = true;
      contradiction.steady_ns = contradiction.stuck_ns = 0;
      contradiction.runs_away = false;
      contradiction.streak = RefusedStreak{};
      return false;
    }
    absorb(track, fix, part, judgement);
    return true;
  }
  return false;
}

/// Where the position still rests on a solution that is not proven (peak hold), a step within that
/// variance is a correction.
bool InsTracker::was_unproven(InsTrack& track,
                              const MapFix& fix,
                              Part part,
                              const Judgement& judgement) const {
  const Vector3d held_m2 = (track.held_variance_m2 - track.fix_variance_m2).cwiseMax(0.0);
  const Matrix3d S = judgement.S_m2() + Matrix3d(held_m2.asDiagonal());
  if (squared_sigmas(judgement.innovation_m, S, part) > gate_[part]) {
    return false;
  }
  const int first = kSpans[part].first;  // clang 14 captures no structured bindings
  const int count = kSpans[part].count;
  for_each(track, [&](Eskf18& filter) {
    for (int i = first; i < first + count; ++i) {
      filter.P(ins::kPosition + i, ins::kPosition + i) += held_m2(i);
    }
  });
  return judge(track.filter, fix).ratio[part] <= 1.0;
}

/// The receiver has jumped: its error state takes the difference, the position stays.
void InsTracker::absorb(InsTrack& track,
                        const MapFix& fix,
                        Part part,
                        const Judgement& judgement) const {
  const auto [first, count] = kSpans[part];
  for (int i = first; i < first + count; ++i) {
    const double jump_m = judgement.innovation_m(i);
    for_each(track, [&](Eskf18& filter) {
      filter.P(ins::kFixError + i, ins::kFixError + i) += jump_m * jump_m;
    });
    track.doubt_m(i) = std::max(track.doubt_m(i), 0.5 * std::abs(jump_m));
  }
  Contradiction& contradiction = track.parts[part];
  contradiction.streak = RefusedStreak{};
  contradiction.jumped_ns = fix.checked.stamp_ns;
  if (contradiction.absorbed_ns == 0) {
    contradiction.absorbed_ns = fix.checked.stamp_ns;
  }
  track.doubt_until_ns = std::max(track.doubt_until_ns, fix.checked.stamp_ns);
}

/// The filter was wrong: the position is free to follow the fix.
void InsTracker::recover(InsTrack& track, const MapFix& fix, Part part) const {
  const int first = kSpans[part].first;  // clang 14 captures no structured bindings
  const int count = kSpans[part].count;
  const Contradiction& before = track.parts[part];
  const bool lost = (before.filter_is_suspect || before.unsteady) && part == kHorizontal;
  const Vector3d apart = fix.antenna_map_m - antenna(track.filter, lever_base_m_);
  for_each(track, [&](Eskf18& filter) {
    renew_fix_error(filter, fix, part);
    for (int i = first; i < first + count; ++i) {
      reset_axis(filter, ins::kPosition + i, apart(i) * apart(i) + fix.covariance_map_m2(i, i));
    }
    if (lost) {
      filter.P.diagonal().segment<3>(ins::kVelocity).array() += kLostSpeed_mps * kLostSpeed_mps;
      doubt_rotation(filter, {0.0, 0.0, kLostYaw_rad});
    }
  });
  for (int i = first; i < first + count; ++i) {
    track.doubt_m(i) = std::max(track.doubt_m(i), std::abs(apart(i)));
  }
  track.doubt_until_ns = fix.checked.stamp_ns + from_seconds(config_.eskf18.doubt_hold_s);
  track.parts[part] = Contradiction{};
  ++track.recoveries;
}

/// Whether fixes that the filter has gone without for so long are believed.
bool InsTracker::is_over(const InsTrack& track, const MapFix& fix, Part part) const {
  const Contradiction& contradiction = track.parts[part];
  const double since_s = to_seconds(fix.checked.stamp_ns - contradiction.absorbed_ns);
  // For how long it stood no more, silences aside: away it has proven nothing.
  const double moved_s =
      to_seconds(fix.checked.stamp_ns - contradiction.stuck_ns) - silence_s(track, fix);
  const bool stuck = contradiction.unsteady && contradiction.stuck_ns > 0 && moved_s < kSteady_s;
  return since_s > (stuck ? kStuckLimits : 1.0) * config_.eskf18.absorb_limit_s;
}

void InsTracker::end_absorptions(InsTrack& track, const MapFix& fix) const {
  const Eskf18Config& c = config_.eskf18;
  for (const Part part : kParts) {
    const Nanoseconds since_ns = track.parts[part].absorbed_ns;
    if (since_ns == 0) {
      continue;
    }
    const auto [first, count] = kSpans[part];
    const double error_m = track.filter.fix_error_map_m.segment(first, count).norm();
    const double sigma_m =
        std::sqrt(c.fix_slow_share * fix.covariance_map_m2.diagonal().segment(first, count).sum());
    if (error_m < kStillAbsorbed * sigma_m && !track.parts[part].unsteady) {
      track.parts[part].absorbed_ns = 0;
    } else if (is_over(track, fix, part)) {
      recover(track, fix, part);
    } else {
      track.doubt_until_ns = std::max(track.doubt_until_ns, fix.checked.stamp_ns);
    }
  }
}

}  // namespace trigpoint::gps_odometry
