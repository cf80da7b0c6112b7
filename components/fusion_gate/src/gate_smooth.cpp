// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Mode smooth: Algorithm I with hysteresis, joined by tests of the values against LIO, and what
// becomes of T_map_odom when they find out a liar.
#include "trigpoint/base/sentence.hpp"

#include "gate.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::size_t kRawFixesKept = 64;
constexpr double kReplacementTimeout_s = 1.0;
constexpr double kWorthGoingBack_m = 0.01;

/// A fix's covariance with the variances that were measured, and not less than the receiver's own.
Eigen::Matrix3d as_measured(const Eigen::Matrix3d& said_m2,
                            const Eigen::Vector3d& scatter_m2,
                            const Eigen::Vector3d& least_share) {
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  for (int axis = 0; axis < 3; ++axis) {
    if (std::isfinite(scatter_m2[axis])) {
      scale[axis] = std::sqrt(std::max(least_share[axis], scatter_m2[axis] / said_m2(axis, axis)));
    }
  }
  return scale.asDiagonal() * said_m2 * scale.asDiagonal();
}

}  // namespace

void FusionGate::Impl::remember_raw(const AcceptedFix& fix) {
  raw_fixes.push_back(fix);
  if (raw_fixes.size() > kRawFixesKept) {
    raw_fixes.pop_front();
  }
}

/// As the receiver said it; null when that was not heard.
const AcceptedFix* FusionGate::Impl::raw_of(Nanoseconds stamp_ns) const {
  const auto raw = std::find_if(raw_fixes.begin(), raw_fixes.end(), [&](const AcceptedFix& r) {
    return r.stamp_ns == stamp_ns;
  });
  return raw == raw_fixes.end() ? nullptr : &*raw;
}

/// With the receiver's own statement, which counts for no more than it was measured to be worth.
Witness FusionGate::Impl::witness_of(const AcceptedFix& fix,
                                     const PoseBuffer::Sample& at_fix) const {
  Witness witness{fix, std::nullopt, at_fix};
  if (const AcceptedFix* said = raw_of(fix.stamp_ns)) {
    witness.raw = *said;
    auto variance_m2 = witness.raw->covariance_map_m2.diagonal().head<2>();
    variance_m2 = variance_m2.cwiseMax(receiver.least_m2(level_m2(*said))).eval();
  }
  return witness;
}

void FusionGate::Impl::measure_receiver(const Witness& witness) {
  const AcceptedFix* said = raw_of(witness.fix.stamp_ns);
  if (said == nullptr || monitor.is_blind(*lio, 0) || monitor.is_blind(*lio, 1)) {
    receiver.forget_way();
    return;
  }
  const Eigen::Vector3d lio_odom_m = witness.lio_pose.T_frame_child * robot.antenna_position_base_m;
  receiver.add(level_m2(*said),
               said->antenna_map_m.head<2>(),
               lio_odom_m.head<2>(),
               lio->T_map_odom.yaw_rad);
}

/// GPS filters double the sigmas that receivers report and add floors, because some receivers are
/// optimistic. Where LIO testifies that this one is not, its own variance is what is left.
Eigen::Vector3d FusionGate::Impl::least_share_of(const Witness& witness) const {
  if (!witness.raw) {
    return Eigen::Vector3d::Ones();
  }
  const double scale = config.smooth.raw_sigma_scale * config.smooth.raw_sigma_scale;
  const Eigen::Vector3d own_m2 = witness.raw->covariance_map_m2.diagonal() / scale;
  return own_m2.cwiseQuotient(witness.fix.covariance_map_m2.diagonal())
      .cwiseMax(kLeastShare)
      .cwiseMin(1.0);
}

void FusionGate::Impl::judge_values(const AcceptedFix& fix,
                                    const PoseBuffer::Sample& at_fix,
                                    Output& out) {
  const Witness witness = witness_of(fix, at_fix);
  measure_receiver(witness);
  const MonitorOutcome outcome = monitor.judge(witness, *lio);
  tell_changes(outcome, out);
  if (outcome.realignment) {
    replace(
        witness,
        {lio->odom_epoch, outcome.realignment->T_map_odom, outcome.realignment->covariance, true},
        out);
    monitor.begin_anew();
    monitor.on_alignment(witness);
    placements.clear();
    verdicts.record(fix.stamp_ns, true, "alignment", "carries a new alignment");
    tell(out,
         Severity::kWarning,
         "realigned",
         "the alignment rested on wrong fixes: odom is aligned with map anew");
    return;
  }
  if (outcome.slid_map_m) {
    settle(*outcome.slid_map_m, witness, out);
    return;
  }
  go_back(outcome, witness, out);
  if (outcome.is_settling) {
    verdicts.record(fix.stamp_ns, false, "settling", "contradicts T_map_odom after a silence");
    return;
  }
  const AxisChoices choices = choose_smoothly(variance_of(fix));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    sigma_passes[axis] = choices[axis].sigma_m <= choices[axis].threshold_m;
  }
  if (any_fused(choices) || outcome.trusted[0]) {
    AcceptedFix weighted = fix;
    if (outcome.trusted[0]) {
      weighted.covariance_map_m2 =
          as_measured(fix.covariance_map_m2, monitor.scatter_map_m2(*lio), least_share_of(witness));
    } else {
      weighted = witness.as_received();
      weighted.covariance_map_m2 =
          Eigen::Matrix3d::Identity() *
          std::max(monitor.doubted_variance_m2(), fix.covariance_map_m2.diagonal().maxCoeff());
    }
    send_rows(weighted, choices, out);
    monitor.on_rows({choices[0].decision == AxisDecision::kFused,
                     choices[1].decision == AxisDecision::kFused,
                     choices[2].decision == AxisDecision::kFused});
    return;
  }
  const Refusal& why = monitor.trust(Part::kLevel).reason();
  verdicts.record(fix.stamp_ns, false, why.code, why.reason);
}

void FusionGate::Impl::go_back(const MonitorOutcome& outcome, const Witness& witness, Output& out) {
  const auto& since = outcome.taken_in_since_ns;
  const std::optional<Nanoseconds> wanted = since[0] ? since[0] : since[1];
  if (!wanted) {
    return;
  }
  const Eigen::Vector3d here_odom_m = witness.lio_pose.T_frame_child.p;
  const auto alignment = placements.as_of(
      *wanted, *lio, here_odom_m, witness.lio_pose.distance_m, !since[0].has_value());
  if (!alignment) {
    return;
  }
  const double change_m =
      (alignment->T_map_odom.pose() * here_odom_m - lio->T_map_odom.pose() * here_odom_m).norm();
  if (change_m < kWorthGoingBack_m) {
    return;
  }
  replace(witness, *alignment, out);
  monitor.on_taken_back(!since[0].has_value());
  tell(out,
       Severity::kWarning,
       "taken_back",
       sentence("GPS crept away: T_map_odom goes back to where it was %.1f s ago, by %.2f m",
                to_seconds(witness.fix.stamp_ns - *wanted),
                change_m));
}

/// East and north go where the fixes since a silence say; yaw and height are left alone. Where
/// T_map_odom was before the slide is nowhere to go back to.
void FusionGate::Impl::settle(const Eigen::Vector3d& slid_map_m,
                              const Witness& witness,
                              Output& out) {
  const AcceptedFix& fix = witness.as_received();
  const Eigen::Matrix3d covariance_m2 = floored(fix.covariance_map_m2, config.min_sigma_m);
  const double off_m = slid_map_m.head<2>().norm();
  replace(witness,
          moved_aside(*lio,
                      witness.lio_pose.T_frame_child.p,
                      slid_map_m.head<2>(),
                      covariance_m2.topLeftCorner<2, 2>()),
          out);
  awaited->places_anew = true;
  placements.clear();
  const std::string text =
      sentence("LIO slid by %.2f m without GPS: east and north are placed anew", off_m);
  verdicts.record(witness.fix.stamp_ns, true, "alignment", text);
  tell(out, Severity::kWarning, "placed_anew", text);
}

void FusionGate::Impl::replace(const Witness& witness, const Alignment& alignment, Output& out) {
  const Eigen::Vector3d here_odom_m = witness.lio_pose.T_frame_child.p;
  const Eigen::Vector3d target_map_m = alignment.T_map_odom.pose() * here_odom_m;
  awaited = AwaitedReplacement{now_ns,
                               here_odom_m,
                               target_map_m,
                               (lio->T_map_odom.pose() * here_odom_m - target_map_m).norm(),
                               false};
  out.state_updates.push_back(rows.make_alignment(witness.fix, alignment));
}

bool FusionGate::Impl::is_replacement_awaited(Output& out) {
  if (!awaited) {
    return false;
  }
  const double distance_m =
      (lio->T_map_odom.pose() * awaited->here_odom_m - awaited->target_map_m).norm();
  const bool taken = distance_m < 0.5 * awaited->first_distance_m;
  const bool too_late = to_seconds(now_ns - awaited->since_ns) > kReplacementTimeout_s;
  if (!taken && !too_late) {
    return true;
  }
  if (!taken) {
    tell(out,
         Severity::kError,
         "replacement_not_taken",
         "the mapper did not take the T_map_odom that replaces its own");
  }
  if (taken && awaited->places_anew) {
    monitor.on_settled();
    placements.clear();  // of what the mapper said before it took the new one
  }
  awaited.reset();
  return false;
}

AxisChoices FusionGate::Impl::choose_smoothly(const Eigen::Vector3d& reported_m2) const {
  const Eigen::Vector3d scatter_m2 = monitor.scatter_map_m2(*lio);
  const Trust& level = monitor.trust(Part::kLevel);
  AxisChoices choices;
  for (int axis = 0; axis < 3; ++axis) {
    AxisChoice& choice = choices[static_cast<std::size_t>(axis)];
    const bool scatters = scatter_m2[axis] > reported_m2[axis];
    choice = choose_trusted(axis, scatters ? scatter_m2[axis] : reported_m2[axis]);
    choice.reason += scatters ? ", measured against LIO" : "";
    const Trust& trust = level.trusted() ? monitor.trust(part_of(axis)) : level;
    if (!trust.trusted()) {
      choice.decision = AxisDecision::kLio;
      choice.reason = trust.reason().reason;
    }
    if (!level.trusted() && carries_though_doubted(axis)) {
      choice.decision = AxisDecision::kFused;
      choice.sigma_m = std::sqrt(monitor.doubted_variance_m2());
      choice.reason += sentence(
          "; LIO is blind along it and knows less: GPS carries the axis with "
          "a sigma of %.2f m, as it contradicts LIO",
          choice.sigma_m);
    }
    if (choice.decision == AxisDecision::kLio && monitor.is_blind(*lio, axis)) {
      choice.decision = AxisDecision::kCoast;
      choice.reason += kCoasting;
    }
  }
  return choices;
}

/// Algorithm I: an axis that GPS does not hold opens at the threshold, one that it holds closes
/// only above leave_factor times it. Where LIO is blind GPS is taken as soon as it knows more.
AxisChoice FusionGate::Impl::choose_trusted(int axis, double variance_m2) const {
  const double factor =
      sigma_passes[static_cast<std::size_t>(axis)] ? config.smooth.leave_factor : 1.0;
  AxisChoice choice = algorithm_one(variance_m2, factor * threshold_m[axis]);
  if (choice.decision == AxisDecision::kLio && monitor.is_blind(*lio, axis) &&
      variance_m2 <= monitor.blind_variance_map_m2(*lio)[axis]) {
    choice.decision = AxisDecision::kFused;
    choice.reason += ", but LIO is blind along it: GPS carries the axis";
  }
  return choice;
}

/// Where LIO is blind and GPS is not believed neither is right: the one that is off by less is
/// taken for what it is worth.
bool FusionGate::Impl::carries_though_doubted(int axis) const {
  return part_of(axis) == Part::kLevel && monitor.is_blind(*lio, axis) &&
         std::isfinite(monitor.doubted_variance_m2()) &&
         monitor.doubted_variance_m2() <= monitor.blind_variance_map_m2(*lio)[axis];
}

void FusionGate::Impl::tell_changes(const MonitorOutcome& outcome, Output& out) const {
  for (const Part part : kParts) {
    const char* name = part == Part::kLevel ? "east and north" : "height";
    if (outcome.change[index_of(part)] == Trust::Change::kDoubted) {
      tell(out,
           Severity::kWarning,
           "gps_doubted",
           std::string("GPS is not believed in ") + name + ": " +
               monitor.trust(part).reason().reason);
    } else if (outcome.change[index_of(part)] == Trust::Change::kReadmitted) {
      tell(out, Severity::kInfo, "gps_readmitted", std::string("GPS is believed again in ") + name);
    }
  }
}

}  // namespace trigpoint::fusion_gate
