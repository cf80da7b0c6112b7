// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/sentence.hpp"

#include "checkpoint_of.hpp"
#include "mapper_impl.hpp"

#include <utility>

namespace trigpoint::lio_mapper {

namespace {

/// A frozen map is loaded anew when the robot has come this far from where it was, of half_side_m.
constexpr double kReloadShare = 0.3;

}  // namespace

void LioMapper::Impl::begin_epoch_anew(const std::string& code,
                                       const std::string& why,
                                       Output& output) {
  filter.reset();
  resumption.reset();
  stored_points = nullptr;
  lost_track.forget();
  keyframe_trigger = KeyframeTrigger(config.keyframes);
  imu_rate = ImuRateOdometry(config.imu, config.imu_rate_odometry_hz);
  if (past) {
    past->on_new_epoch();
  }
  ++status.odom_epoch;
  ++status.reset.counter;
  status.reset.delta = {};
  status.health = LioHealth::kInit;
  status.aligned = false;
  status.T_map_odom = {};
  status.T_map_odom_covariance = Matrix6d::Identity() * kUnknownVariance;
  output.events.push_back({Severity::kWarning,
                           sweeps.front().end_ns,
                           code,
                           "odom epoch " + std::to_string(status.odom_epoch) + " begins: " + why});
}

bool LioMapper::Impl::resume_at_once(Output& output) {
  if (auto found = resumption->attempt_at_once(T_base_lidar, imu, sweeps)) {
    go_on_from(std::move(*found), output);
  }
  return !resumption;
}

/// False while another attempt may come.
bool LioMapper::Impl::resume_from(const StartResult& result, Output& output) {
  auto found = resumption->attempt(result, T_base_lidar, imu, sweeps);
  if (!found) {
    if (resumption->has_given_up()) {
      begin_epoch_anew("lio_not_resumed", std::string(resumption->obstacle()), output);
    }
    return false;
  }
  go_on_from(std::move(*found), output);
  return true;
}

void LioMapper::Impl::go_on_from(Resumption::Found found, Output& output) {
  filter.emplace(config, T_base_lidar, found.initial, [this](Stage s) { begin_stage(s); });
  filter->take_over(std::move(found.past));
  loaded_at_m = found.initial.state.T_odom_base.p;
  last_used_ns = found.initial.stamp_ns;
  resumption.reset();
  output.events.push_back(
      {Severity::kInfo, found.initial.stamp_ns, "lio_resumed", "odom goes on, " + found.text});
}

/// A frozen map is loaded around the robot as that moves.
void LioMapper::Impl::update_map(const ScanOutcome& outcome) {
  if (!stored_points) {
    PointCloud inserted = filter->insert(outcome);
    if (past) {
      past->on_inserted(std::move(inserted));
    }
    return;
  }
  const Eigen::Vector3d& p = filter->state().T_odom_base.p;
  if ((p - loaded_at_m).norm() > kReloadShare * config.local_map.half_side_m) {
    auto map = load_map(config.local_map, stored_points, status.odom_epoch, p, false);
    filter->swap_map(map);
    loaded_at_m = p;
  }
}

void LioMapper::resume(const Checkpoint& checkpoint,
                       StoredPoints points,
                       const ResumeOptions& options) {
  Impl& impl = *impl_;
  set_status(checkpoint, impl.status);
  if (options.frozen_map) {  // a run of its own, which counts for itself
    LioStatus& s = impl.status;
    s.scans_received = s.scans_used = s.imu_received = s.rows_applied = s.rows_refused = 0;
    s.scans_refused.clear();
  } else {
    impl.refused_scans.set(checkpoint.scans_refused);
    impl.imu_received_before = checkpoint.imu_received;
  }
  impl.next_keyframe = checkpoint.next_keyframe;
  impl.stored_points = options.frozen_map ? points : nullptr;
  impl.resumption.emplace(impl.config, checkpoint, std::move(points), options);
}

std::optional<Checkpoint> LioMapper::checkpoint() const {
  if (!impl_->filter) {
    return std::nullopt;
  }
  impl_->refresh_status();
  return checkpoint_of(*impl_->filter, impl_->status, impl_->next_keyframe);
}

std::vector<StoredRow> LioMapper::take_rows() {
  return std::exchange(impl_->rows_decided, {});
}

/// Puts the sweep's stamps right when the LiDAR's clock was set while it ran. A sweep whose stamp
/// nothing explains yet would lay its points where the robot was not: refused.
bool LioMapper::Impl::refuse_doubtful(Sweep& sweep, Nanoseconds cloud_stamp_ns, Output& output) {
  if (imu.empty()) {
    return false;
  }
  const auto verdict = clock_steps.look(cloud_stamp_ns, sweep.end_ns, imu.newest_ns());
  sweep.begin_ns += clock_steps.offset_ns();
  sweep.end_ns += clock_steps.offset_ns();
  const double step_s = to_seconds(clock_steps.step_ns());
  if (verdict == ClockSteps::Verdict::kDoubtful && sweep.end_ns > newest_sweep_ns) {
    refuse_sweep("stamp_in_doubt",
                 sweep.end_ns,
                 sentence("refused a sweep whose stamp is %+.3f s off, by the scanner's rhythm and "
                          "by when it came, expected one of the clock so far",
                          step_s),
                 output);
    return true;
  }
  if (verdict == ClockSteps::Verdict::kStepped) {
    sweep.clock_sigma_s = clock_steps.sigma_s();
    output.events.push_back(
        {Severity::kWarning,
         sweep.end_ns,
         "lidar_clock_stepped",
         sentence(
             "the LiDAR's clock was set by %+.4f s while it ran (sigma %.4f s): its stamps are "
             "corrected by %+.4f s from here on; synchronise it before driving",
             step_s,
             clock_steps.sigma_s(),
             to_seconds(clock_steps.offset_ns()))});
  }
  return false;
}

}  // namespace trigpoint::lio_mapper
