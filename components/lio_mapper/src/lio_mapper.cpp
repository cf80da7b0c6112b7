// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/so3.hpp"

#include "calibration_report.hpp"
#include "checkpoint_of.hpp"
#include "decoded_cloud.hpp"
#include "downsample.hpp"
#include "mapper_impl.hpp"

#include <cmath>
#include <cstdlib>
#include <deque>
#include <utility>

namespace trigpoint::lio_mapper {

namespace {

/// Sweeps that may wait for IMU samples: three seconds at 10 Hz.
constexpr std::size_t kMaxWaitingSweeps = 30;
/// At the end of a log the last sweep may outlive the last IMU sample by this much.
constexpr double kHeldImu_s = 0.05;
/// A first sweep may begin this much before the IMU does.
constexpr double kEarlySweep_s = 0.15;
/// IMU kept before the first start, beyond the levelling window.
constexpr double kKeptBeforeStart_s = 5.0;
/// A pose less certain than this relative to the local map is not a good one.
constexpr double kDegradedSigma_m = 0.3;

/// So long after the last usable scan it is said that there is none.
constexpr double kBlind_s = 0.5;

std::string seconds_text(Nanoseconds duration_ns) {
  return std::to_string(to_seconds(duration_ns)) + " s";
}

void require(bool holds, const std::string& rule) {
  if (!holds) {
    throw ConfigError("lio_mapper: " + rule);
  }
}

const Config& checked(const Config& config) {
  require(config.sweep.min_range_m < config.sweep.max_range_m,
          "sweep.min_range_m must be less than sweep.max_range_m");
  require(config.imu.max_gap_s <= config.imu.lost_gap_s,
          "imu.max_gap_s must not exceed imu.lost_gap_s");
  require(config.local_map.half_side_m > config.local_map.prune_every_m,
          "local_map.half_side_m must exceed local_map.prune_every_m");
  return config;
}

}  // namespace

void LioMapper::Impl::refuse_sweep(const std::string& reason,
                                   Nanoseconds stamp_ns,
                                   const std::string& text,
                                   Output& output) {
  refused_scans.add(reason);
  output.events.push_back({Severity::kWarning, stamp_ns, "scan_refused_" + reason, text});
}

void LioMapper::Impl::refuse_front(const std::string& reason,
                                   const std::string& text,
                                   Output& output) {
  refuse_sweep(reason, sweeps.front().end_ns, text, output);
  sweeps.pop_front();
}

void LioMapper::Impl::queue(Sweep sweep, Output& output) {
  if (newest_sweep_ns != 0 && sweep.end_ns <= newest_sweep_ns) {
    refuse_sweep("stamp_not_after_previous",
                 sweep.end_ns,
                 "refused a sweep that ends " + seconds_text(newest_sweep_ns - sweep.end_ns) +
                     " before its predecessor, expected stamps that grow",
                 output);
    return;
  }
  if (sweep.points.empty()) {
    refuse_sweep("no_points",
                 sweep.end_ns,
                 "refused a sweep without a usable point (" +
                     std::to_string(sweep.points_received) + " received)",
                 output);
    return;
  }
  newest_sweep_ns = sweep.end_ns;
  sweeps.push_back(std::move(sweep));
  if (sweeps.size() > kMaxWaitingSweeps) {
    const Nanoseconds missing_ns = imu.empty() ? 0 : sweeps.front().end_ns - imu.newest_ns();
    const std::string newest = imu.empty() ? "none has come"
                                           : "the newest is " + seconds_text(std::abs(missing_ns)) +
                                                 (missing_ns >= 0 ? " older" : " newer") +
                                                 " than the sweep's end";
    refuse_front("imu_missing",
                 "refused a sweep that waited too long for IMU samples: " + newest +
                     "; do both clocks agree?",
                 output);
  }
}

std::optional<std::string> LioMapper::Impl::objection_to(const Sweep& sweep) const {
  const Nanoseconds begin_ns = std::max(sweep.begin_ns, filter ? filter->stamp_ns() : 0);
  if (imu.empty() || sweep.end_ns <= imu.oldest_ns() ||
      to_seconds(imu.oldest_ns() - begin_ns) > kEarlySweep_s) {
    return "imu_starts_later";
  }
  if (imu.longest_gap_s(std::max(begin_ns, imu.oldest_ns()), sweep.end_ns) >
      config.imu.lost_gap_s) {
    return "imu_gap";
  }
  return std::nullopt;
}

void LioMapper::Impl::start_when_possible(Output& output) {
  while (!sweeps.empty() && sweeps.front().end_ns <= imu.newest_ns() &&
         objection_to(sweeps.front())) {
    refuse_front(
        *objection_to(sweeps.front()), "refused a sweep that the IMU does not cover", output);
  }
  if (resumption && resume_at_once(output)) {
    return;
  }
  if (can_start(config.start, imu, sweeps)) {
    begin(output);
  }
}

void LioMapper::Impl::begin(Output& output) {
  if (resumption && !resumption->is_due(sweeps.size())) {
    return;
  }
  const StartResult result = start(config, T_base_lidar, imu, sweeps);
  if (result.trouble) {
    if (to_seconds(imu.newest_ns() - trouble_told_ns) > 1.0) {
      output.events.push_back(*result.trouble);
      trouble_told_ns = imu.newest_ns();
    }
    refuse_front("imu_implausible", result.trouble->text, output);
    return;
  }
  if (resumption && (resume_from(result, output) || resumption)) {
    return;
  }
  filter.emplace(config, T_base_lidar, result.initial, [this](Stage stage) { begin_stage(stage); });
  last_used_ns = result.initial.stamp_ns;
  output.events.push_back(
      {Severity::kInfo,
       result.initial.stamp_ns,
       "lio_started",
       "odom begins " +
           (result.at_rest ? "at rest"
                           : "in motion at " + std::to_string(result.speed_mps) + " m/s") +
           ", roll and pitch " +
           std::to_string(roll_pitch_yaw_of(result.initial.state.T_odom_base.q).x()) + " and " +
           std::to_string(roll_pitch_yaw_of(result.initial.state.T_odom_base.q).y()) + " rad"});
}

void LioMapper::Impl::process_what_is_covered(Output& output) {
  if (!filter && !imu.empty()) {
    start_when_possible(output);
  }
  while (filter && !sweeps.empty() && sweeps.front().end_ns <= imu.newest_ns()) {
    process_front(output);
  }
}

void LioMapper::Impl::process_front(Output& output) {
  const Sweep& sweep = sweeps.front();
  if (const auto reason = objection_to(sweep)) {
    refuse_front(*reason, "refused a sweep that the IMU does not cover", output);
    return;
  }
  const bool doubtful = to_seconds(sweep.end_ns - last_used_ns) > config.matching.lost_after_s ||
                        imu.longest_gap_s(filter->stamp_ns(), sweep.end_ns) > config.imu.lost_gap_s;
  const ScanOutcome outcome = filter->process(
      sweep, imu, lost_track.search_for(*filter, T_base_lidar.p, sweep.end_ns, doubtful));
  if (const auto event = lost_track.conclude(outcome, sweep.end_ns)) {
    output.events.push_back(*event);
    if (!lost_track.is_searching()) {
      ++status.reset.counter;
      status.reset.delta = lost_track.delta();
    }
  }
  if (lost_track.must_begin_anew(sweep.end_ns)) {
    begin_epoch_anew("lio_not_recovered", "the track was lost and not found again", output);
    return;
  }
  for (const StateUpdate& update : filter->take_covered()) {
    count_row(update, filter->apply(update), output);
  }
  update_map(outcome);
  begin_stage(Stage::kReport);
  judge_health(outcome, sweep.end_ns, output);
  calibration_report.look(filter->calibration(), sweep.end_ns, output.events);
  report(outcome, output);
  sweeps.pop_front();
  imu.forget_before(filter->stamp_ns());
  imu_rate.restart(*filter, imu);
  begin_stage(Stage::kOutside);
}

void LioMapper::Impl::judge_health(const ScanOutcome& outcome,
                                   Nanoseconds stamp_ns,
                                   Output& output) {
  const LioHealth before = status.health;
  if (outcome.used) {
    last_used_ns = stamp_ns;
    ++status.scans_used;
    const double sigma2 = filter->pose_covariance_in_local_map().diagonal().head<3>().maxCoeff();
    status.health =
        sigma2 > kDegradedSigma_m * kDegradedSigma_m ? LioHealth::kDegraded : LioHealth::kOk;
  } else {
    refused_scans.add("too_few_matches");
    const bool lost = to_seconds(stamp_ns - last_used_ns) > config.matching.lost_after_s;
    status.health = lost ? LioHealth::kLost : LioHealth::kDegraded;
  }
  if (status.health == before || status.health == LioHealth::kInit) {
    return;
  }
  const bool good = status.health == LioHealth::kOk;
  output.events.push_back(
      {good ? Severity::kInfo : Severity::kWarning,
       stamp_ns,
       good ? "lio_ok" : (status.health == LioHealth::kLost ? "lio_lost" : "lio_degraded"),
       (outcome.first ? "the map begins with " + std::to_string(outcome.points) + " points"
                      : std::to_string(outcome.matches) + " of " + std::to_string(outcome.points) +
                            " points matched") +
           " (at least " + std::to_string(config.matching.min_matches) + " needed), " +
           seconds_text(stamp_ns - last_used_ns) + " since the last usable scan" +
           (good ? "" : "; going on with the IMU alone where the scan does not help")});
}

/// Without any scan to judge: the LiDAR is covered, dead, or its sweeps are refused.
void LioMapper::Impl::judge_absence(Nanoseconds stamp_ns, Output& output) {
  const double blind_s = to_seconds(stamp_ns - last_used_ns);
  if (!filter || blind_s < kBlind_s || status.health == LioHealth::kLost) {
    return;
  }
  const LioHealth before = status.health;
  status.health = blind_s > config.matching.lost_after_s ? LioHealth::kLost : LioHealth::kDegraded;
  if (status.health != before) {
    output.events.push_back(
        {Severity::kWarning,
         stamp_ns,
         status.health == LioHealth::kLost ? "lio_lost" : "lio_degraded",
         "no usable scan for " + std::to_string(blind_s) + " s; going on with the IMU alone"});
  }
}

void LioMapper::Impl::refresh_status() {
  status.imu_received = imu_received_before + intake.received();
  status.scans_refused = refused_scans.counts();
  if (!filter) {
    return;
  }
  status.stamp_ns = filter->stamp_ns();
  status.aligned = filter->aligned();
  status.T_map_odom = filter->state().placement();
  if (status.aligned) {
    status.T_map_odom_covariance = filter->placement_covariance();
  }
  status.distance_m = filter->distance_m();
  const Matrix6d covariance = filter->pose_covariance_in_local_map();
  for (int i = 0; i < 6; ++i) {
    status.sigma[static_cast<std::size_t>(i)] = std::sqrt(std::max(0.0, covariance(i, i)));
  }
}

Keyframe LioMapper::Impl::make_keyframe(const ScanOutcome& outcome, const Odometry& odometry) {
  Keyframe keyframe;
  keyframe.id = next_keyframe++;
  keyframe.stamp_ns = odometry.stamp_ns;
  keyframe.odom_epoch = status.odom_epoch;
  keyframe.T_odom_base = odometry.T_frame_child;
  keyframe.pose_covariance = odometry.pose_covariance;
  keyframe.aligned = filter->aligned();
  keyframe.T_map_odom = filter->state().placement();
  keyframe.points_base = downsample(outcome.points_base, config.keyframes.voxel_m);
  return keyframe;
}

void LioMapper::Impl::report(const ScanOutcome& outcome, Output& output) {
  ScanResult result;
  const InertialSample& newest = imu.samples().back();
  const State& state = filter->state();
  result.odometry = odometry_of(state,
                                filter->stated_covariance(),
                                filter->pose_covariance(),
                                newest.gyro_radps,
                                config.imu,
                                filter->stamp_ns());
  status.observability = outcome.observability;
  refresh_status();
  result.status = status;
  result.status.scan_ms = sweeps.front().decoding_ms;
  result.points_odom = transformed(outcome.thinned_base, state.T_odom_base);
  if (outcome.used && filter->is_placed() && !stored_points &&
      keyframe_trigger.fires(filter->stamp_ns(), state.T_odom_base)) {
    result.keyframe = make_keyframe(outcome, result.odometry);
  }
  remember(result);
  result.checkpoint = checkpoint_of(*filter, status, next_keyframe);
  result.rows = std::exchange(rows_decided, {});
  output.scans.push_back(std::move(result));
}

void LioMapper::Impl::align(const Alignment& alignment, Nanoseconds stamp_ns, Output& output) {
  const bool usable =
      alignment.T_map_odom.p.allFinite() && std::isfinite(alignment.T_map_odom.yaw_rad) &&
      alignment.covariance.allFinite() && alignment.covariance.diagonal().minCoeff() > 0.0;
  if (!filter || alignment.odom_epoch != status.odom_epoch || !usable ||
      (filter->aligned() && !alignment.replaces)) {
    return;  // a repeated first alignment is no news
  }
  filter->align(alignment);
  refresh_status();
  output.events.push_back({Severity::kInfo,
                           stamp_ns,
                           "lio_aligned",
                           "odom is placed in map: yaw " +
                               std::to_string(alignment.T_map_odom.yaw_rad) + " rad, sigma " +
                               std::to_string(std::sqrt(alignment.covariance(0, 0))) + " rad"});
}

void LioMapper::Impl::count_row(const StateUpdate& update,
                                const RowVerdict& verdict,
                                Output& output) {
  if (verdict.outcome != RowOutcome::kWaits) {
    const bool applied = verdict.outcome == RowOutcome::kApplied;
    rows_decided.push_back(
        {update, status.odom_epoch, applied, applied ? "applied" : verdict.reason});
    rows_decided.back().update.first_alignment.reset();
    if (past) {
      past->on_row(rows_decided.back(), filter->state().placement(), filter->state().T_odom_base.p);
    }
  }
  if (verdict.outcome == RowOutcome::kApplied) {
    ++status.rows_applied;
    status.last_row_fix_ns = update.fix_stamp_ns;
  } else if (verdict.outcome == RowOutcome::kRefused) {
    ++status.rows_refused;
    status.last_refusal =
        verdict.reason + " (fix of " + std::to_string(update.fix_stamp_ns) + " ns)";
    output.events.push_back(
        {Severity::kWarning,
         update.fix_stamp_ns,
         "row_refused_" + verdict.reason,
         "refused the GPS row of a fix " +
             (status.scans_used == 0 ? "before the first scan"
                                     : seconds_text(status.stamp_ns - update.fix_stamp_ns) +
                                           " before the newest scan") +
             ": " + verdict.reason});
  }
}

void LioMapper::Impl::apply_rows(const StateUpdate& update, Output& output) {
  if (update.first_alignment) {
    align(*update.first_alignment, update.fix_stamp_ns, output);
  }
  const bool any = std::any_of(update.decision.begin(), update.decision.end(), [](AxisDecision d) {
    return d == AxisDecision::kFused;
  });
  if (!any) {
    return;
  }
  if (!filter) {
    count_row(update, {RowOutcome::kRefused, "not_started"}, output);
    return;
  }
  count_row(update, filter->apply(update), output);
  imu_rate.restart(*filter, imu);
  refresh_status();
}

LioMapper::LioMapper(const Config& config, const RobotConfig& robot)
    : impl_(std::make_unique<Impl>(checked(config), robot)) {}

LioMapper::~LioMapper() = default;

Output LioMapper::on_imu(const ImuSample& sample) {
  Output output;
  const auto accepted = impl_->intake.accept(sample, impl_->config.imu.max_gap_s, output.events);
  if (!accepted) {
    return output;
  }
  impl_->imu.push(*accepted);
  if (!impl_->filter) {
    impl_->imu.forget_before(
        std::min(accepted->stamp_ns,
                 impl_->sweeps.empty() ? accepted->stamp_ns : impl_->sweeps.front().begin_ns) -
        from_seconds(kKeptBeforeStart_s));
  }
  impl_->process_what_is_covered(output);
  impl_->judge_absence(accepted->stamp_ns, output);
  output.odometry_imu_rate = impl_->imu_rate.advance(impl_->imu);
  return output;
}

Output LioMapper::on_cloud(const PointCloudMessage& cloud) {
  impl_->begin_stage(Stage::kDecode);
  DecodedCloud decoded = impl_->decoder.decode(cloud);
  impl_->begin_stage(Stage::kOutside);
  return on_decoded_cloud(std::move(decoded));
}

Output LioMapper::on_decoded_cloud(DecodedCloud cloud) {
  DecodedCloud::Content& content = *cloud.content_;
  Output output;
  output.events = std::move(content.events);
  ++impl_->status.scans_received;
  if (const auto* refusal = std::get_if<SweepRefusal>(&content.sweep)) {
    impl_->refuse_sweep(refusal->code, content.stamp_ns, refusal->text, output);
    return output;
  }
  Sweep& sweep = std::get<Sweep>(content.sweep);
  if (!impl_->refuse_doubtful(sweep, content.stamp_ns, output)) {
    impl_->queue(std::move(sweep), output);
  }
  impl_->process_what_is_covered(output);
  return output;
}

Output LioMapper::on_state_update(const StateUpdate& update) {
  Output output;
  impl_->apply_rows(update, output);
  return output;
}

Output LioMapper::finish() {
  Output output;
  Impl& impl = *impl_;
  // A log shorter than the levelling window starts with what it has.
  if (!impl.filter && impl.sweeps.size() >= 2 && !impl.imu.empty() &&
      impl.sweeps[1].end_ns <= impl.imu.newest_ns()) {
    impl.begin(output);
  }
  while (impl.filter && !impl.sweeps.empty() &&
         to_seconds(impl.sweeps.front().end_ns - impl.imu.newest_ns()) < kHeldImu_s) {
    impl.process_front(output);
  }
  while (!impl.sweeps.empty()) {
    impl.refuse_front("imu_missing", "the log ended before the IMU covered this sweep", output);
  }
  impl.refresh_status();
  return output;
}

void LioMapper::observe_stages(StageObserver observer) {
  impl_->observe = std::move(observer);
}

std::size_t LioMapper::map_memory_bytes() const {
  return impl_->filter ? impl_->filter->map().memory_bytes() : 0;
}

PointCloud LioMapper::local_map() const {
  return impl_->filter ? impl_->filter->map().points() : PointCloud{};
}

Calibration LioMapper::calibration() const {
  if (impl_->filter) {
    return impl_->filter->calibration();
  }
  Calibration configured;
  configured.T_base_lidar = impl_->T_base_lidar;
  return configured;
}

LioStatus LioMapper::status() const {
  impl_->refresh_status();
  return impl_->status;
}

}  // namespace trigpoint::lio_mapper
