// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include "gate.hpp"

#include <algorithm>
#include <exception>

namespace trigpoint::fusion_gate {

namespace {

constexpr Nanoseconds kLioBuffer_ns = 10 * kNanosecondsPerSecond;
constexpr Nanoseconds kGpsBuffer_ns = 5 * kNanosecondsPerSecond;  // a takeover looks back so far

}  // namespace

FusionGate::Impl::Impl(const Config& config_in, const RobotConfig& robot_in)
    : config(config_in),
      robot(robot_in),
      mode(mode_of(config_in.mode)),
      threshold_m(threshold_sigma_m(config_in)),
      sources(config_in),
      rows(config_in, robot_in.antenna_position_base_m),
      lio_poses(kLioBuffer_ns, from_seconds(config_in.alignment.max_interpolation_gap_s)),
      window(config_in.alignment),
      queue(config_in.max_fix_age_s),
      monitor(config_in, robot_in.antenna_position_base_m),
      placements(config_in),
      hand_over(config_in.smooth.hand_over_mps, config_in.smooth.hand_over_radps),
      receiver(config_in),
      gps_poses(kGpsBuffer_ns, from_seconds(config_in.alignment.max_interpolation_gap_s)) {}

FusionGate::FusionGate(const Config& config, const RobotConfig& robot)
    : impl_(std::make_unique<Impl>(config, robot)) {}

FusionGate::~FusionGate() = default;

Output FusionGate::on_gps_odometry(const Odometry& odometry, const std::string& writer) {
  Output out;
  impl_->take_gps_odometry(odometry, writer, out);
  impl_->finish(out, false);
  return out;
}

Output FusionGate::on_gps_status(const GpsStatus& status, const std::string& writer) {
  Output out;
  impl_->take_gps_status(status, writer, out);
  impl_->finish(out, false);
  return out;
}

Output FusionGate::on_fix(const GnssFix& fix) {
  Output out;
  impl_->take_raw_fix(fix, out);
  impl_->finish(out, true);
  return out;
}

Output FusionGate::on_yaw(const YawMeasurement& yaw) {
  Output out;
  impl_->take_yaw(yaw, out);
  return out;
}

Output FusionGate::on_datum(const Datum& datum) {
  Output out;
  if (impl_->frame && impl_->frame->datum().id() == datum.id()) {
    return out;
  }
  if (impl_->frame && impl_->frame->datum().elected_ns <= datum.elected_ns) {
    impl_->tell(
        out,
        Severity::kError,
        "datum_conflict",
        "datum " + datum.id() + " is not adopted: " + impl_->datum_id() + " was elected earlier");
    return out;
  }
  const bool keeps_waiting = !impl_->frame && impl_->names_datum(datum.id());
  try {
    impl_->frame.emplace(datum);
  } catch (const std::exception& fault) {
    impl_->tell(out, Severity::kError, "datum_refused", fault.what());
    return out;
  }
  if (!keeps_waiting) {
    impl_->refuse_waiting({"other_datum", "the datum changed while the fix waited"});
  }
  impl_->alignment_sent_ns.reset();
  impl_->window.clear();
  impl_->monitor.begin_anew();
  impl_->raw_fixes.clear();
  impl_->gps_poses_writer.clear();  // begun anew
  impl_->receiver.forget_way();
  for (auto& [writer, source] : impl_->foreign_sources) {
    source.forget_alignment();
  }
  impl_->tell(out, Severity::kInfo, "datum_adopted", "map begins at " + datum.id());
  return out;
}

Output FusionGate::on_lio_odometry(const Odometry& odometry) {
  Output out;
  Impl& gate = *impl_;
  if (!gate.lio_poses.add(odometry.stamp_ns, odometry.T_frame_child, odometry.pose_covariance)) {
    gate.tell(out,
              Severity::kWarning,
              "lio_odometry_refused",
              "lio/odometry is not finite or its stamp does not advance");
    return out;
  }
  gate.advance(odometry.stamp_ns);
  gate.last_lio_ns = std::max(gate.last_lio_ns.value_or(odometry.stamp_ns), odometry.stamp_ns);
  gate.last_scan_covariance = odometry.pose_covariance;
  const bool imu_rate_silent =
      !gate.last_imu_rate_ns ||
      to_seconds(gate.now_ns - *gate.last_imu_rate_ns) > gate.config.imu_rate_timeout_s;
  if (imu_rate_silent) {
    gate.publish_lio(odometry, out);
  }
  gate.finish(out, false);
  return out;
}

Output FusionGate::on_lio_odometry_imu_rate(const Odometry& odometry) {
  Output out;
  Impl& gate = *impl_;
  if (!odometry.T_frame_child.is_finite()) {
    gate.tell(
        out, Severity::kWarning, "lio_odometry_refused", "lio/odometry_imu_rate is not finite");
    return out;
  }
  gate.advance(odometry.stamp_ns);
  gate.last_lio_ns = std::max(gate.last_lio_ns.value_or(odometry.stamp_ns), odometry.stamp_ns);
  gate.last_imu_rate_ns = odometry.stamp_ns;
  gate.publish_lio(odometry, out);
  gate.finish(out, false);
  return out;
}

Output FusionGate::on_lio_status(const LioStatus& status) {
  Output out;
  impl_->take_lio_status(status, out);
  impl_->finish(out, false);
  return out;
}

std::optional<Alignment> FusionGate::best_alignment() const {
  return impl_->best_alignment();
}

}  // namespace trigpoint::fusion_gate
