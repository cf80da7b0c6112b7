// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/fused_odometry.hpp"
#include "gate.hpp"
#include "sentence.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kDefaultFixInterval_s = 1.0;

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

void FusionGate::Impl::publish_lio(const Odometry& odometry, Output& out) {
  if (lio_carries()) {
    publish(fuse(odometry, lio->T_map_odom, lio->T_map_odom_covariance), out);
  }
}

void FusionGate::Impl::publish_gps(Output& out) {
  const std::optional<Odometry> gps = gps_carries() ? gps_in_map() : std::nullopt;
  if (gps) {
    publish(move_to_base(*gps, robot.antenna_position_base_m), out);
  }
}

void FusionGate::Impl::publish(const Odometry& odometry, Output& out) {
  const bool finite = odometry.T_frame_child.is_finite() && odometry.pose_covariance.allFinite();
  if (!finite || (last_fused_ns && odometry.stamp_ns <= *last_fused_ns)) {
    return;
  }
  last_fused_ns = odometry.stamp_ns;
  out.fused = odometry;
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

AxisStatus FusionGate::Impl::axis_status(const AxisChoice& choice) const {
  AxisStatus axis{AxisSource::kNone, choice.sigma_m, choice.threshold_m, choice.reason};
  if (lio_carries()) {
    axis.source = choice.decision == AxisDecision::kFused ? AxisSource::kFused : AxisSource::kLio;
    const std::optional<std::string> missing = missing_fix();
    if (missing && mode != Mode::kLio) {
      axis.source = AxisSource::kLio;
      axis.reason = *missing + ", " + choice.reason;
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
  const AxisChoices choices = choose_axes(mode, gps_variance_m2(), threshold_m);
  std::transform(
      choices.begin(), choices.end(), result.axes.begin(), [this](const AxisChoice& choice) {
        return axis_status(choice);
      });
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
  if (now_ns == 0) {
    return;  // no data time yet: raw fixes alone do not set it
  }
  const bool due =
      !last_status_ns || to_seconds(now_ns - *last_status_ns) >= config.status_period_s;
  if (status_wanted || verdict_changed || due) {
    out.status = status();
    last_status_ns = now_ns;
    verdict_changed = false;
  }
}

}  // namespace trigpoint::fusion_gate
