// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/sentence.hpp"
#include "trigpoint/base/so3.hpp"

#include "fusion/fused_odometry.hpp"
#include "gate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kDefaultFixInterval_s = 1.0;
constexpr double kHighestSpeed_mps = 60.0;
constexpr double kGpsStep_m = 0.5;  // a GPS filter was set anew: more than corrections at 5 Hz move

/// What LIO's pose may differ from where the last ones led: corrections by scans, and a change of
/// speed over half of what they tell of.
constexpr double kLioStep_m = 0.02;
constexpr double kLioChange_mps = 1.0;

/// What a robot does to its velocity, so that more is none of its motion.
constexpr double kHardestChange_mps2 = 3.0;

constexpr double kMotion_s = 0.5;       // over which the robot's motion is seen
constexpr double kLeastMotion_s = 0.1;  // for less, the twist

void keep(const Odometry& odometry, std::deque<Odometry>& recent) {
  recent.push_back(odometry);
  while (to_seconds(odometry.stamp_ns - recent.front().stamp_ns) > kMotion_s) {
    recent.pop_front();
  }
}

/// Where recent poses lead; nullopt when they are of too short a time.
std::optional<Pose> led_on(const std::deque<Odometry>& recent, Nanoseconds stamp_ns) {
  const double known_s =
      recent.empty() ? 0.0 : to_seconds(recent.back().stamp_ns - recent.front().stamp_ns);
  if (known_s < kLeastMotion_s) {
    return std::nullopt;
  }
  const Pose& last = recent.back().T_frame_child;
  const Pose& first = recent.front().T_frame_child;
  const double share = to_seconds(stamp_ns - recent.back().stamp_ns) / known_s;
  const Eigen::Vector3d turned_rad = so3_log(first.q.conjugate() * last.q);
  // On an arc a chord lies half way between the headings at its ends.
  const Eigen::Quaterniond past_to_coming_chord = so3_exp(0.5 * (1.0 + share) * turned_rad);
  const Eigen::Vector3d moved_first_m = first.q.conjugate() * (last.p - first.p);
  return Pose{(last.q * so3_exp(share * turned_rad)).normalized(),
              last.p + share * (first.q * (past_to_coming_chord * moved_first_m))};
}

}  // namespace

bool FusionGate::Impl::lio_carries() const {
  return aligned() && last_lio_ns && to_seconds(now_ns - *last_lio_ns) <= config.lio_timeout_s;
}

bool FusionGate::Impl::gps_carries() const {
  if (mode == Mode::kLio || lio_carries()) {
    return false;
  }
  if (last_fused_ns) {
    return true;
  }
  const bool lio_lives = last_lio_ns && to_seconds(now_ns - *last_lio_ns) <= config.lio_timeout_s;
  return !lio_lives && first_gps_ns &&
         to_seconds(now_ns - *first_gps_ns) >= config.gps_only_after_s;
}

std::optional<Odometry> FusionGate::Impl::gps_in_map() const {
  const GpsSource* source = sources.followed_source();
  if (source == nullptr || !source->odometry) {
    return std::nullopt;
  }
  if (!source->status) {
    const auto foreign_source = foreign_sources.find(sources.followed());
    return foreign_source == foreign_sources.end()
               ? std::nullopt
               : foreign_source->second.in_map(*source->odometry);
  }
  const bool ours =
      !source->status->datum_id.empty() && (!frame || source->status->datum_id == datum_id());
  return ours ? source->odometry : std::nullopt;
}

Eigen::Vector3d FusionGate::Impl::gps_variance_m2() const {
  const std::optional<Odometry> gps = gps_in_map();
  if (!gps || to_seconds(now_ns - gps->stamp_ns) > config.source_timeout_s) {
    return Eigen::Vector3d::Constant(kNaN);
  }
  return gps->pose_covariance.diagonal().head<3>();
}

/// Of the GPS odometry at the fix's stamp where the filter keeps a record of it.
Eigen::Vector3d FusionGate::Impl::variance_of(const AcceptedFix& fix) const {
  return fix.is_recorded ? Eigen::Vector3d(fix.covariance_map_m2.diagonal()) : gps_variance_m2();
}

/// The drift that lio/odometry adds to its covariance is what T_map_odom's covariance is about: in
/// map it must not count twice. lio/status tells sigma in the local map, and the odometry by how
/// much it grew since that scan.
Odometry FusionGate::Impl::with_covariance_in_local_map(const Odometry& odometry) const {
  const bool told = std::all_of(
      lio->sigma.begin(), lio->sigma.end(), [](double s) { return std::isfinite(s) && s > 0.0; });
  if (!told || !last_scan_covariance) {
    return odometry;
  }
  Odometry result = odometry;
  result.pose_covariance.setZero();
  for (int i = 0; i < 6; ++i) {
    const double sigma = lio->sigma[static_cast<std::size_t>(i)];
    const double growth = odometry.pose_covariance(i, i) - (*last_scan_covariance)(i, i);
    result.pose_covariance(i, i) = sigma * sigma + std::max(0.0, growth);
  }
  return result;
}

/// A new odom epoch or a found track shows in the odometry before lio/status tells of it: such a
/// pose must not meet the old T_map_odom.
bool FusionGate::Impl::has_odom_jumped(const Odometry& odometry) {
  if (last_odom && !odom_jumped_at_status_ns) {
    const double dt_s = std::abs(to_seconds(odometry.stamp_ns - last_odom->stamp_ns));
    const double moved_m = (odometry.T_frame_child.p - last_odom->T_frame_child.p).norm();
    if (moved_m > kHighestSpeed_mps * dt_s + kGpsStep_m) {
      odom_jumped_at_status_ns = lio->stamp_ns;
    }
  }
  if (odom_jumped_at_status_ns && lio->stamp_ns > *odom_jumped_at_status_ns) {
    odom_jumped_at_status_ns.reset();
  }
  if (!odom_jumped_at_status_ns) {
    last_odom = odometry;
  }
  return odom_jumped_at_status_ns.has_value();
}

/// What is not published has not taken over: a mapper that comes back begins behind what GPS
/// carried meanwhile.
bool FusionGate::Impl::can_be_published(const Odometry& odometry) const {
  const bool finite = odometry.T_frame_child.is_finite() && odometry.pose_covariance.allFinite();
  return finite && (!last_fused_ns || odometry.stamp_ns > *last_fused_ns);
}

void FusionGate::Impl::publish_lio(const Odometry& odometry, Output& out) {
  if (!lio_carries() || has_odom_jumped(odometry) || !can_be_published(odometry)) {
    return;
  }
  const Odometry in_map =
      fuse(with_covariance_in_local_map(odometry), lio->T_map_odom, lio->T_map_odom_covariance);
  const bool goes_on = last_carrier == Carrier::kLio && last_epoch == lio->odom_epoch;
  const Pose unchanged = goes_on ? last_T_map_odom.pose() * without_step(odometry)
                                 : as_predicted(odometry.stamp_ns, in_map.T_frame_child);
  keep_motion(goes_on);
  keep(odometry, recent_odom);
  last_carrier = Carrier::kLio;
  last_epoch = lio->odom_epoch;
  last_T_map_odom = lio->T_map_odom;
  publish(in_map, unchanged, out);
}

void FusionGate::Impl::publish_gps(Output& out) {
  const std::optional<Odometry> gps = gps_carries() ? gps_in_map() : std::nullopt;
  if (!gps || !can_be_published(*gps)) {
    return;
  }
  const Odometry base = move_to_base(*gps, robot.antenna_position_base_m);
  const Pose predicted = as_predicted(base.stamp_ns, base.T_frame_child);
  const bool steps = (predicted.p - base.T_frame_child.p).norm() > kGpsStep_m;
  const bool same_filter = last_gps_writer == sources.followed();
  const bool goes_on = last_carrier == Carrier::kGps && same_filter && !steps;
  Pose unchanged = predicted;
  if (goes_on) {
    unchanged = base.T_frame_child;
    if (gps_dead_reckons()) {
      unchanged.p -= to_seconds(base.stamp_ns - last_raw->stamp_ns) * gps_error_map_mps;
    }
  } else if (last_carrier == Carrier::kLio) {
    gps_error_map_mps = gps_velocity_error_mps();
    unchanged = as_gps_moved(base, predicted);
  } else {
    gps_error_map_mps.setZero();
  }
  keep_motion(goes_on);
  last_carrier = Carrier::kGps;
  last_gps_writer = sources.followed();
  publish(base, unchanged, out);
}

void FusionGate::Impl::remember_gps(const Odometry& gps_in_map) {
  if (gps_poses_writer != sources.followed()) {
    gps_poses_writer = sources.followed();
    gps_poses.forget_before(std::numeric_limits<Nanoseconds>::max());
  }
  const Odometry base = move_to_base(gps_in_map, robot.antenna_position_base_m);
  gps_poses.add(base.stamp_ns, base.T_frame_child, base.pose_covariance);
}

/// No fix holds the GPS filter's velocity.
bool FusionGate::Impl::gps_dead_reckons() const {
  const GpsSource* source = sources.followed_source();
  return source != nullptr && source->status && source->status->health != GpsHealth::kOk &&
         source->status->health != GpsHealth::kDegraded;
}

/// Of a GPS filter that dead-reckons: by how much faster it went, in map, than what was published
/// until then. Over the next seconds its velocity is off by as much.
Eigen::Vector3d FusionGate::Impl::gps_velocity_error_mps() const {
  const double known_s = recent_raw.empty()
                             ? 0.0
                             : to_seconds(recent_raw.back().stamp_ns - recent_raw.front().stamp_ns);
  if (known_s < kLeastMotion_s || !gps_dead_reckons()) {
    return Eigen::Vector3d::Zero();
  }
  const PoseBuffer::Answer from = gps_poses.at(recent_raw.front().stamp_ns);
  const PoseBuffer::Answer to = gps_poses.at(recent_raw.back().stamp_ns);
  if (from.coverage != PoseBuffer::Coverage::kCovered ||
      to.coverage != PoseBuffer::Coverage::kCovered) {
    return Eigen::Vector3d::Zero();
  }
  const Pose& last = recent_raw.back().T_frame_child;
  const Eigen::Quaterniond R_map_gps = last.q * to.sample.T_frame_child.q.conjugate();
  const Eigen::Vector3d gps_moved_m = to.sample.T_frame_child.p - from.sample.T_frame_child.p;
  return (R_map_gps * gps_moved_m - (last.p - recent_raw.front().T_frame_child.p)) / known_s;
}

/// From the last raw pose as the GPS filter has moved since: through turns and stops that nobody
/// foresees. `predicted` where it was not heard then, knows no heading, or moved as no robot does.
Pose FusionGate::Impl::as_gps_moved(const Odometry& base, const Pose& predicted) const {
  if (!last_raw || !knows_heading(base)) {
    return predicted;
  }
  const PoseBuffer::Answer before = gps_poses.at(last_raw->stamp_ns);
  if (before.coverage != PoseBuffer::Coverage::kCovered) {
    return predicted;
  }
  const double dt_s = to_seconds(base.stamp_ns - last_raw->stamp_ns);
  const Pose& last = last_raw->T_frame_child;
  const Eigen::Quaterniond R_map_gps = last.q * before.sample.T_frame_child.q.conjugate();
  const Eigen::Vector3d gps_moved_m = base.T_frame_child.p - before.sample.T_frame_child.p;
  const Pose moved{(R_map_gps * base.T_frame_child.q).normalized(),
                   last.p + R_map_gps * gps_moved_m - dt_s * gps_error_map_mps};
  const double beside_m = (moved.p - predicted.p).norm();
  return beside_m <= kGpsStep_m + 0.5 * kHardestChange_mps2 * dt_s * dt_s ? moved : predicted;
}

/// LIO finds the robot elsewhere than it went when surfaces come into sight along an axis where
/// there had been none. Such a step is no motion.
Pose FusionGate::Impl::without_step(const Odometry& odometry) {
  Pose pose = odometry.T_frame_child;
  const std::optional<Pose> led = led_on(recent_odom, odometry.stamp_ns);
  if (led) {
    const double dt_s = to_seconds(odometry.stamp_ns - recent_odom.back().stamp_ns);
    if ((pose.p - led->p).norm() > kLioStep_m + kLioChange_mps * dt_s) {
      pose.p = led->p;
      recent_odom.clear();
    }
  }
  return pose;
}

/// Where another source carries on, or the same one was set anew, the way from its predecessor's
/// pose to its own is no motion.
void FusionGate::Impl::keep_motion(bool goes_on) {
  if (!goes_on) {
    recent_raw.clear();
    recent_odom.clear();
  }
}

/// Where the last raw poses lead; `otherwise` when there is none. By their displacement: the twist
/// of a single one, as of a LIO that has just lost its track, may be anything.
Pose FusionGate::Impl::as_predicted(Nanoseconds stamp_ns, const Pose& otherwise) const {
  if (!last_raw) {
    return otherwise;
  }
  const Pose& last = last_raw->T_frame_child;
  const double dt_s = to_seconds(stamp_ns - last_raw->stamp_ns);
  return led_on(recent_raw, stamp_ns)
      .value_or(last * Pose{so3_exp(last_raw->angular_radps * dt_s), last_raw->linear_mps * dt_s});
}

void FusionGate::Impl::publish(const Odometry& odometry, const Pose& unchanged, Output& out) {
  if (!can_be_published(odometry)) {
    return;
  }
  last_fused_ns = odometry.stamp_ns;
  last_raw = odometry;
  keep(odometry, recent_raw);
  out.fused_raw = odometry;
  // Who dead-reckons knows the robot's place worse than those who carried before it.
  const bool stays = last_carrier == Carrier::kGps && gps_dead_reckons();
  const auto offset = stays ? HandOver::Offset::kStays : HandOver::Offset::kShrinks;
  out.fused = mode == Mode::kSmooth ? hand_over.follow(odometry, unchanged, offset) : odometry;
}

std::optional<std::string> FusionGate::Impl::missing_fix() const {
  if (!last_accepted_ns) {
    return "no accepted fix yet";
  }
  // 1.5 of the usual interval, and never less than the default: fixes come up to 500 ms late.
  const double usual_s = fix_intervals_s.empty()
                             ? kDefaultFixInterval_s
                             : *std::min_element(fix_intervals_s.begin(), fix_intervals_s.end());
  const double age_s = to_seconds(now_ns - *last_accepted_ns);
  if (age_s <= std::max(kDefaultFixInterval_s, 1.5 * usual_s)) {
    return std::nullopt;
  }
  return sentence("no accepted fix for %.1f s", age_s);
}

AxisStatus FusionGate::Impl::axis_status(std::size_t index, const AxisChoice& choice) const {
  AxisStatus axis{AxisSource::kNone, choice.sigma_m, choice.threshold_m, choice.reason};
  if (lio_carries()) {
    axis.source = choice.decision == AxisDecision::kFused ? AxisSource::kFused : AxisSource::kLio;
    const std::optional<std::string> missing = missing_fix();
    if (missing && mode != Mode::kLio) {
      axis.source = AxisSource::kLio;
      const bool coasts = mode == Mode::kSmooth && choice.decision == AxisDecision::kFused &&
                          monitor.is_blind(*lio, static_cast<int>(index));
      axis.reason = *missing + ", " + choice.reason + (coasts ? kCoasting : "");
    }
  } else if (gps_carries() && gps_in_map()) {
    axis.source = AxisSource::kGps;
    axis.reason = last_lio_ns ? "LIO is not heard or not aligned" : "no LIO";
  } else {
    axis.reason = "not aligned yet: " +
                  window.obstacle().value_or("waiting for the mapper to take the alignment");
  }
  return axis;
}

FusionStatus FusionGate::Impl::status() const {
  FusionStatus result;
  result.stamp_ns = now_ns;
  result.mode = config.mode;
  const AxisChoices choices = aligned() && mode == Mode::kSmooth
                                  ? choose_smoothly(gps_variance_m2())
                                  : choose_axes(mode, gps_variance_m2(), threshold_m);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.axes[axis] = axis_status(axis, choices[axis]);
  }
  result.aligned = aligned();
  if (const std::optional<Alignment> best = best_alignment()) {
    result.T_map_odom = best->T_map_odom;
    result.yaw_sigma_rad = std::sqrt(best->covariance(0, 0));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto index = static_cast<Eigen::Index>(axis) + 1;
      result.position_sigma_m[axis] = std::sqrt(best->covariance(index, index));
    }
  }
  result.verdict = verdicts.newest();
  result.fixes_seen = fixes_seen;
  result.fixes_used = verdicts.used();
  result.verdicts = verdicts.counts();
  // So that the counts always add up to the fixes seen.
  if (fixes_seen > verdicts.total()) {
    result.verdicts.push_back({"waiting", fixes_seen - verdicts.total()});
  }
  result.gps_source = sources.followed();
  return result;
}

void FusionGate::Impl::finish(Output& out, bool status_wanted) {
  follow_healthiest(out);
  judge_waiting(out);
  if (now_ns == 0) {
    return;  // no data time yet: raw fixes alone do not set it
  }
  const bool due =
      !last_status_ns || to_seconds(now_ns - *last_status_ns) >= config.status_period_s;
  if (status_wanted || status_is_news || due) {
    out.status = status();
    out.status->judged = verdicts.take_new();
    last_status_ns = now_ns;
    status_is_news = false;
  }
}

}  // namespace trigpoint::fusion_gate
