// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/sentence.hpp"
#include "trigpoint/base/so3.hpp"

#include "gate.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kAlignmentWait_s = 0.5;  // a mapper has it with its next scan

}  // namespace

void FusionGate::Impl::judge_waiting(Output& out) {
  while (!is_mapper_awaited(out)) {
    const ToldFix* next = queue.next(now_ns);
    if (next == nullptr) {
      return;
    }
    const PoseBuffer::Answer lio_pose = lio_poses.at(next->fix.stamp_ns);
    const auto refusal = next->refusal();
    if (!refusal && lio_pose.coverage == PoseBuffer::Coverage::kNotYet) {
      return;
    }
    const ToldFix told = queue.take();
    status_is_news = true;
    if (refusal) {
      note_refused(told, lio_pose);
      verdicts.record(told.fix.stamp_ns, false, refusal->code, refusal->reason);
      tell(out, Severity::kWarning, "fix_refused", refusal->reason);
    } else {
      judge(told.fix, lio_pose, out);
    }
  }
}

/// What the filter's gate refuses is still the receiver's word.
void FusionGate::Impl::note_refused(const ToldFix& told, const PoseBuffer::Answer& lio_pose) {
  const bool by_gate =
      told.refused_by_filter && told.refused_by_filter->code == refused_code(kFilterGate);
  if (!by_gate || mode != Mode::kSmooth || !aligned() ||
      lio_pose.coverage != PoseBuffer::Coverage::kCovered) {
    return;
  }
  const Witness witness = witness_of(told.fix, lio_pose.sample);
  if (witness.raw) {
    monitor.on_refused(witness);
  }
}

/// An alignment is on its way: what comes next is to be held against it. Once in an epoch: a mapper
/// that did not take the first one may never take any, and fixes must not pile up behind it.
bool FusionGate::Impl::is_mapper_awaited(Output& out) {
  if (aligned()) {
    alignment_sent_ns.reset();
    return is_replacement_awaited(out);
  }
  if (!lio || alignment_not_taken || !alignment_sent_ns) {
    return false;
  }
  alignment_not_taken = to_seconds(now_ns - *alignment_sent_ns) >= kAlignmentWait_s;
  return !alignment_not_taken;
}

void FusionGate::Impl::judge(const AcceptedFix& fix,
                             const PoseBuffer::Answer& lio_pose,
                             Output& out) {
  if (lio_pose.coverage != PoseBuffer::Coverage::kCovered) {
    verdicts.record(fix.stamp_ns, false, "no_lio_pose", "no LIO pose at the fix's stamp");
  } else if (!aligned()) {
    add_pair(fix, lio_pose.sample, out);
  } else if (const auto late =
                 check_age(fix, last_lio_ns, config.max_fix_age_s + kJudgingSlack_s)) {
    verdicts.record(fix.stamp_ns, false, late->code, late->reason);
    tell(out, Severity::kWarning, "fix_refused", late->reason);
  } else if (mode == Mode::kSmooth) {
    judge_values(fix, lio_pose.sample, out);
  } else {
    make_rows(fix, out);
  }
}

void FusionGate::Impl::take_yaw(const YawMeasurement& yaw, Output& out) {
  const HeadingVerdict verdict = check_heading(yaw, robot);
  if (!verdict.measurement) {
    if (headings_told.insert(verdict.reason).second) {
      tell(out, Severity::kWarning, verdict.reason.c_str(), verdict.text);
    }
  } else if (!aligned()) {
    heading.hear(*verdict.measurement);
  }
}

/// Blind along both horizontal axes of odom, as on a field without features.
bool FusionGate::Impl::is_lio_lost() const {
  return lio && std::min(lio->sigma[0], lio->sigma[1]) > config.smooth.lio_blind_sigma_m;
}

/// Where LIO does not witness any way, its attitude is the gyroscopes' and still good, and the
/// filter's heading is what the fixes tell of it. Elsewhere that is not used: LIO's way is better,
/// and the fixes would be counted twice.
void FusionGate::Impl::hear_heading_of(const Odometry& gps_in_map) {
  constexpr Eigen::Index kYaw = 5;
  const double variance_rad2 = gps_in_map.pose_covariance(kYaw, kYaw);
  const double most_rad = config.alignment.max_yaw_sigma_rad;
  if (is_lio_lost() && variance_rad2 > 0.0 && variance_rad2 < most_rad * most_rad) {
    filter_heading.hear(
        {gps_in_map.stamp_ns, yaw_of(gps_in_map.T_frame_child.q), std::sqrt(variance_rad2)});
  }
}

/// That a heading is not used is said once an alignment.
void FusionGate::Impl::tell_of_heading(const std::optional<YawPrior>& prior, Output& out) {
  constexpr const char* kCode = "heading_contradicted";
  if (prior && window.solution() && window.solution()->contradicts_heading &&
      headings_told.insert(kCode).second) {
    tell(out,
         Severity::kWarning,
         kCode,
         sentence("the headings of robot.yaw_topic put odom at yaw %.1f deg, GPS and LIO at %.1f "
                  "deg: not used; look at robot.yaw_offset_rad",
                  prior->yaw_rad * kDegrees,
                  window.solution()->T_map_odom.yaw_rad * kDegrees));
  }
}

void FusionGate::Impl::add_pair(const AcceptedFix& fix,
                                const PoseBuffer::Sample& at_fix,
                                Output& out) {
  const bool was_admitted = window.admitted();
  const Eigen::Vector3d antenna_odom_m = at_fix.T_frame_child * robot.antenna_position_base_m;
  const Eigen::Vector3d variance_m2 = floored(fix.covariance_map_m2, config.min_sigma_m).diagonal();
  const Witness witness = witness_of(fix, at_fix);
  const AcceptedFix* said = raw_of(fix.stamp_ns);
  const Eigen::Vector2d received_off_m =
      (witness.as_received().antenna_map_m - fix.antenna_map_m).head<2>();
  heading.match(lio_poses);
  filter_heading.match(lio_poses);
  const std::optional<YawPrior> measured = heading.prior();
  window.set_heading(measured || !is_lio_lost() ? measured : filter_heading.prior());
  const bool added = window.add({fix.stamp_ns,
                                 fix.antenna_map_m,
                                 variance_m2,
                                 antenna_odom_m,
                                 at_fix.distance_m,
                                 least_share_of(witness).mean(),
                                 {},
                                 received_off_m,
                                 level_m2(said == nullptr ? fix : *said)});
  tell_of_heading(measured, out);
  if (!window.admitted()) {
    const std::string why = window.obstacle().value_or("no solution");
    verdicts.record(fix.stamp_ns,
                    added,
                    added ? "alignment" : "alignment_redundant",
                    (added ? "taken for the alignment, not admitted yet: "
                           : "too near to the last pair; alignment not admitted yet: ") +
                        why);
    return;
  }
  const Alignment alignment{
      lio ? lio->odom_epoch : 0, window.solution()->T_map_odom, window.solution()->covariance};
  out.state_updates.push_back(rows.make_alignment(fix, alignment));
  alignment_sent_ns = now_ns;
  receiver.on_alignment(window.solution()->said_m2, window.solution()->received_m2);
  monitor.on_alignment(witness);
  verdicts.record(fix.stamp_ns, true, "alignment", "carries the first alignment");
  if (!was_admitted) {
    tell(out,
         Severity::kInfo,
         "alignment_admitted",
         sentence("odom is aligned with map: yaw %.2f deg, sigma %.2f deg",
                  alignment.T_map_odom.yaw_rad * kDegrees,
                  window.solution()->yaw_sigma_rad() * kDegrees));
  }
}

void FusionGate::Impl::make_rows(const AcceptedFix& fix, Output& out) {
  const AxisChoices choices = choose_axes(mode, variance_of(fix), threshold_m);
  if (mode == Mode::kLio) {
    verdicts.record(fix.stamp_ns, false, "mode_lio", "mode lio takes no GPS rows");
    return;
  }
  send_rows(fix, choices, out);
}

void FusionGate::Impl::send_rows(const AcceptedFix& fix, const AxisChoices& choices, Output& out) {
  const bool used = any_fused(choices);
  out.state_updates.push_back(rows.make(fix, choices));
  std::string reason = used ? "rows:" : "no row:";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    reason += std::string(axis == 0   ? " east "
                          : axis == 1 ? ", north "
                                      : ", up ") +
              choices[axis].reason;
  }
  const bool all = std::all_of(choices.begin(), choices.end(), [](const AxisChoice& c) {
    return c.decision == AxisDecision::kFused;
  });
  verdicts.record(fix.stamp_ns,
                  used,
                  all    ? "used"
                  : used ? "used_some_axes"
                         : "sigma_above_threshold",
                  reason);
}

std::optional<Alignment> FusionGate::Impl::best_alignment() const {
  if (aligned()) {
    return Alignment{
        lio->odom_epoch, lio->T_map_odom, lio->T_map_odom_covariance.topLeftCorner<4, 4>()};
  }
  if (!window.solution()) {
    return std::nullopt;
  }
  return Alignment{
      lio ? lio->odom_epoch : 0, window.solution()->T_map_odom, window.solution()->covariance};
}

void FusionGate::Impl::take_lio_status(const LioStatus& next, Output& out) {
  if (next.aligned &&
      !(next.T_map_odom.pose().is_finite() && next.T_map_odom_covariance.allFinite())) {
    tell(out, Severity::kError, "lio_status_refused", "T_map_odom in lio/status is not finite");
    return;
  }
  advance(next.stamp_ns);
  const bool was_aligned = aligned();
  if (lio && lio->odom_epoch != next.odom_epoch) {
    begin_epoch(next, out);
  } else if (lio && lio->reset.counter != next.reset.counter) {
    monitor.on_odom_step();
    receiver.forget_way();
  }
  lio = next;
  const double distance_m = lio_poses.distance_m();
  if (!aligned()) {
    const Eigen::Vector3d sigma_odom_m(next.sigma[0], next.sigma[1], next.sigma[2]);
    window.on_lio(sigma_odom_m.cwiseAbs2(), std::max(0.0, distance_m - window_distance_m));
  }
  window_distance_m = distance_m;
  monitor.on_lio_status(next, distance_m);
  if (aligned()) {
    alignment_not_taken = false;
    placements.add(next, lio_poses.distance_m());
  }
  if (aligned() && !was_aligned) {
    window.clear();
    heading.clear();
    filter_heading.clear();
  }
}

void FusionGate::Impl::begin_epoch(const LioStatus& next, Output& out) {
  lio_poses.forget_before(next.stamp_ns);
  window.clear();
  heading.clear();
  filter_heading.clear();
  headings_told.clear();
  refuse_waiting({"odom_epoch", "LIO began another odom epoch meanwhile"});
  alignment_sent_ns.reset();
  alignment_not_taken = false;
  monitor.begin_anew();
  receiver.forget_way();
  placements.clear();
  awaited.reset();
  last_odom.reset();
  last_imu_rate_ns.reset();
  tell(out,
       Severity::kWarning,
       "odom_epoch",
       "LIO began odom epoch " + std::to_string(next.odom_epoch) + ": aligning anew");
}

}  // namespace trigpoint::fusion_gate
