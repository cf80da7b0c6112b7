// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include "alignment/alignment_window.hpp"
#include "alignment/pose_buffer.hpp"
#include "checks/accepted_fix.hpp"
#include "checks/foreign_source.hpp"
#include "checks/gps_sources.hpp"
#include "checks/verdicts.hpp"
#include "control/algorithm_one.hpp"
#include "fusion/fused_odometry.hpp"
#include "fusion/rows.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>
#include <map>
#include <numbers>

namespace trigpoint::fusion_gate {

namespace {

constexpr Nanoseconds kLioBuffer_ns = 10 * kNanosecondsPerSecond;
constexpr std::size_t kMaxPendingFixes = 64;
constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kDefaultFixInterval_s = 1.0;

std::string text_of(const char* format, double a, double b = 0.0) {
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(), format, a, b);
  return text.data();
}

/// What the filter says about the newest fix that it refused: the reason whose count grew.
std::string newest_rejection(const GpsStatus& now, const GpsStatus& before) {
  for (const NamedCount& entry : now.rejections) {
    const auto old = std::find_if(before.rejections.begin(),
                                  before.rejections.end(),
                                  [&](const NamedCount& e) { return e.name == entry.name; });
    if (old == before.rejections.end() ? entry.count > 0 : entry.count > old->count) {
      return entry.name;
    }
  }
  return "no reason given";
}

}  // namespace

struct FusionGate::Impl {
  Impl(const Config& config_in, const RobotConfig& robot_in)
      : config(config_in),
        robot(robot_in),
        mode(mode_of(config_in.mode)),
        threshold_m(threshold_sigma_m(config_in)),
        sources(config_in),
        rows(config_in, robot_in.antenna_position_base_m),
        lio_poses(kLioBuffer_ns, from_seconds(config_in.alignment.max_interpolation_gap_s)),
        window(config_in.alignment) {}

  // --- GPS in
  void take_gps_odometry(const Odometry& odometry, const std::string& writer, Output& out);
  void take_gps_status(const GpsStatus& status, const std::string& writer, Output& out);
  void take_raw_fix(const GnssFix& fix, Output& out);
  void note_refusals_of_filter(const GpsStatus& status, const std::optional<GpsStatus>& before);
  void judge(const AcceptedFix& fix, const std::optional<Refusal>& refusal, Output& out);
  void accept(const AcceptedFix& fix, Output& out);
  void follow_healthiest(Output& out);
  ForeignSource& foreign(const std::string& writer);

  // --- alignment and rows
  void align_pending(Output& out);
  void add_pair(const AcceptedFix& fix, const PoseBuffer::Sample& at_fix, Output& out);
  void make_rows(const AcceptedFix& fix, Output& out);
  std::optional<Alignment> best_alignment() const;

  bool aligned() const { return lio && lio->aligned; }

  // --- LIO in
  void take_lio_status(const LioStatus& status, Output& out);
  void begin_epoch(const LioStatus& status, Output& out);

  // --- map out
  bool lio_carries() const;
  bool gps_carries() const;
  std::optional<Odometry> gps_in_map() const;
  Eigen::Vector3d gps_variance_m2() const;
  void publish_lio(const Odometry& odometry, Output& out);
  void publish_gps(Output& out);
  void publish(const Odometry& odometry, Output& out);

  // --- status
  FusionStatus status() const;
  AxisStatus axis_status(const AxisChoice& choice) const;
  std::optional<std::string> missing_fix() const;
  void finish(Output& out, bool status_wanted);

  void advance(Nanoseconds stamp_ns) { now_ns = std::max(now_ns, stamp_ns); }

  void tell(Output& out, Severity severity, const char* code, const std::string& text) const {
    out.events.push_back({severity, now_ns, code, text});
  }

  std::string datum_id() const { return frame ? frame->datum().id() : std::string(); }

  Config config;
  RobotConfig robot;
  Mode mode;
  Eigen::Vector3d threshold_m;
  GpsSources sources;
  Verdicts verdicts;
  RowMaker rows;
  PoseBuffer lio_poses;
  AlignmentWindow window;
  std::deque<AcceptedFix> pending;  // accepted, waiting for LIO to cover their stamps
  std::map<std::string, ForeignSource> foreign_sources;
  std::optional<geodesy::LocalFrame> frame;
  std::optional<LioStatus> lio;

  Nanoseconds now_ns{0};  // data time: the newest stamp of any odometry or status
  std::optional<Nanoseconds> first_gps_ns;
  std::optional<Nanoseconds> last_lio_ns;
  std::optional<Nanoseconds> last_imu_rate_ns;
  std::optional<Nanoseconds> last_fused_ns;
  std::optional<Nanoseconds> last_status_ns;
  std::optional<Nanoseconds> last_accepted_ns;
  std::deque<double> fix_intervals_s;
  std::uint64_t fixes_seen{0};
  bool verdict_changed{false};
};

// --- GPS in ------------------------------------------------------------------------------------

void FusionGate::Impl::take_gps_odometry(const Odometry& odometry,
                                         const std::string& writer,
                                         Output& out) {
  if (const auto fault = sources.on_odometry(odometry, writer)) {
    tell(out, Severity::kWarning, "gps_odometry_refused", *fault + ", from " + writer);
    return;
  }
  advance(odometry.stamp_ns);
  first_gps_ns = first_gps_ns.value_or(odometry.stamp_ns);
  follow_healthiest(out);
  std::vector<AcceptedFix> ready;
  if (!sources.find(writer)->status) {
    ready = foreign(writer).on_odometry(odometry);
  }
  if (writer != sources.followed()) {
    return;
  }
  out.selected = gps_in_map();
  for (const AcceptedFix& fix : ready) {
    judge(fix, std::nullopt, out);
  }
  publish_gps(out);
}

void FusionGate::Impl::take_gps_status(const GpsStatus& gps,
                                       const std::string& writer,
                                       Output& out) {
  advance(gps.stamp_ns);
  const GpsSource* known = sources.find(writer);
  const std::optional<GpsStatus> before = known != nullptr ? known->status : std::nullopt;
  sources.on_status(gps, writer);
  foreign_sources.erase(writer);
  follow_healthiest(out);
  if (writer != sources.followed()) {
    return;
  }
  note_refusals_of_filter(gps, before);
  if (gps.last_accepted_fix_ns != 0 &&
      (!before || gps.last_accepted_fix_ns != before->last_accepted_fix_ns)) {
    judge({gps.last_accepted_fix_ns, gps.accepted_antenna_map_m, gps.accepted_covariance_map_m2},
          check_status(gps, datum_id()),
          out);
  }
}

void FusionGate::Impl::note_refusals_of_filter(const GpsStatus& gps,
                                               const std::optional<GpsStatus>& before) {
  if (!before) {
    return;
  }
  const auto refused = [](const GpsStatus& s) {
    return s.fixes_received - std::min(s.fixes_accepted, s.fixes_received);
  };
  for (std::uint64_t k = refused(*before); k < refused(gps); ++k) {
    const std::string reason = newest_rejection(gps, *before);
    verdicts.record(gps.stamp_ns,
                    false,
                    "refused_by_filter_" + reason,
                    "refused by " + gps.source + ": " + reason);
    verdict_changed = true;
  }
}

void FusionGate::Impl::take_raw_fix(const GnssFix& fix, Output& out) {
  ++fixes_seen;
  verdict_changed = true;
  follow_healthiest(out);
  const geodesy::Geographic place{fix.latitude_deg, fix.longitude_deg, fix.altitude_m};
  const bool wanted =
      std::any_of(foreign_sources.begin(), foreign_sources.end(), [&](const auto& entry) {
        return sources.is_foreign(entry.first, now_ns);
      });
  const bool usable = frame && (fix.status == FixStatus::kFix || fix.status == FixStatus::kSbas ||
                                fix.status == FixStatus::kGbas);
  const auto position = wanted && usable ? frame->to_map(place) : std::nullopt;
  if (!position) {
    if (wanted && !frame) {
      tell(out,
           Severity::kWarning,
           "no_datum",
           "a GPS source without gps/status needs a datum, and there is none yet");
    }
    return;
  }
  const Eigen::Vector3d reported_m2 = fix.covariance_enu_m2.diagonal();
  const bool known = fix.covariance_type != CovarianceType::kUnknown &&
                     fix.covariance_enu_m2.allFinite() && reported_m2.minCoeff() > 0.0;
  const double default_m2 = config.unknown_fix_sigma_m * config.unknown_fix_sigma_m;
  const Eigen::Matrix3d R_map_enu = frame->R_map_enu(place);
  const Eigen::Matrix3d covariance_m2 =
      known ? Eigen::Matrix3d(R_map_enu * fix.covariance_enu_m2 * R_map_enu.transpose())
            : Eigen::Matrix3d(Eigen::Matrix3d::Identity() * default_m2);
  for (auto& [writer, source] : foreign_sources) {
    const auto ready =
        source.on_fix({fix.stamp_ns, *position, floored(covariance_m2, config.min_sigma_m)});
    if (writer == sources.followed()) {
      for (const AcceptedFix& accepted : ready) {
        judge(accepted, std::nullopt, out);
      }
    }
  }
}

ForeignSource& FusionGate::Impl::foreign(const std::string& writer) {
  return foreign_sources.try_emplace(writer, config, robot.antenna_position_base_m).first->second;
}

void FusionGate::Impl::judge(const AcceptedFix& fix,
                             const std::optional<Refusal>& refusal,
                             Output& out) {
  if (!verdicts.is_new(fix.stamp_ns)) {
    return;
  }
  std::optional<Refusal> fault = refusal;
  fault = fault ? fault : check_values(fix);
  fault = fault ? fault : check_age(fix, last_lio_ns, config.max_fix_age_s);
  verdict_changed = true;
  if (fault) {
    verdicts.record(fix.stamp_ns, false, fault->code, fault->reason);
    tell(out, Severity::kWarning, "fix_refused", fault->reason);
    return;
  }
  accept(fix, out);
}

void FusionGate::Impl::accept(const AcceptedFix& fix, Output& out) {
  constexpr std::size_t kIntervals = 5;
  if (last_accepted_ns && fix.stamp_ns > *last_accepted_ns) {
    fix_intervals_s.push_back(to_seconds(fix.stamp_ns - *last_accepted_ns));
  }
  if (fix_intervals_s.size() > kIntervals) {
    fix_intervals_s.pop_front();
  }
  last_accepted_ns = std::max(last_accepted_ns.value_or(fix.stamp_ns), fix.stamp_ns);
  if (aligned()) {
    make_rows(fix, out);
    return;
  }
  pending.push_back(fix);
  if (pending.size() > kMaxPendingFixes) {
    verdicts.record(
        pending.front().stamp_ns, false, "no_lio_pose", "LIO never covered the fix's stamp");
    pending.pop_front();
  }
  align_pending(out);
}

void FusionGate::Impl::follow_healthiest(Output& out) {
  if (!sources.select(now_ns)) {
    return;
  }
  const std::string& writer = sources.followed();
  tell(out,
       writer.empty() ? Severity::kWarning : Severity::kInfo,
       "gps_source",
       writer.empty() ? "no GPS source is heard" : "GPS source followed from now on: " + writer);
}

// --- alignment and rows ------------------------------------------------------------------------

void FusionGate::Impl::align_pending(Output& out) {
  while (!pending.empty()) {
    const AcceptedFix fix = pending.front();
    const PoseBuffer::Answer answer = lio_poses.at(fix.stamp_ns);
    if (answer.coverage == PoseBuffer::Coverage::kNotYet) {
      return;
    }
    pending.pop_front();
    verdict_changed = true;
    if (answer.coverage == PoseBuffer::Coverage::kCovered) {
      add_pair(fix, answer.sample, out);
    } else {
      verdicts.record(fix.stamp_ns,
                      false,
                      "no_lio_pose",
                      "not aligned yet, and no LIO pose at the fix's stamp");
    }
  }
}

void FusionGate::Impl::add_pair(const AcceptedFix& fix,
                                const PoseBuffer::Sample& at_fix,
                                Output& out) {
  const bool was_admitted = window.admitted();
  const Eigen::Vector3d antenna_odom_m = at_fix.T_frame_child * robot.antenna_position_base_m;
  const Eigen::Vector3d variance_m2 = floored(fix.covariance_map_m2, config.min_sigma_m).diagonal();
  const bool added =
      window.add({fix.stamp_ns, fix.antenna_map_m, variance_m2, antenna_odom_m, at_fix.distance_m});
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
  verdicts.record(fix.stamp_ns, true, "alignment", "carries the first alignment");
  if (!was_admitted) {
    tell(out,
         Severity::kInfo,
         "alignment_admitted",
         text_of("odom is aligned with map: yaw %.2f deg, sigma %.2f deg",
                 alignment.T_map_odom.yaw_rad * kDegrees,
                 window.solution()->yaw_sigma_rad() * kDegrees));
  }
}

void FusionGate::Impl::make_rows(const AcceptedFix& fix, Output& out) {
  const AxisChoices choices = choose_axes(mode, gps_variance_m2(), threshold_m);
  verdict_changed = true;
  if (mode == Mode::kLio) {
    verdicts.record(fix.stamp_ns, false, "mode_lio", "mode lio takes no GPS rows");
    return;
  }
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
    return Alignment{lio->odom_epoch, lio->T_map_odom, lio->T_map_odom_covariance};
  }
  if (!window.solution()) {
    return std::nullopt;
  }
  return Alignment{
      lio ? lio->odom_epoch : 0, window.solution()->T_map_odom, window.solution()->covariance};
}

// --- LIO in ------------------------------------------------------------------------------------

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
  }
  lio = next;
  if (aligned() && (!was_aligned || !pending.empty())) {
    window.clear();
    const std::deque<AcceptedFix> waiting = std::move(pending);
    pending.clear();
    for (const AcceptedFix& fix : waiting) {
      make_rows(fix, out);
    }
  }
}

void FusionGate::Impl::begin_epoch(const LioStatus& next, Output& out) {
  lio_poses.forget_before(next.stamp_ns);
  window.clear();
  pending.clear();
  last_imu_rate_ns.reset();
  tell(out,
       Severity::kWarning,
       "odom_epoch",
       "LIO began odom epoch " + std::to_string(next.odom_epoch) + ": aligning anew");
}

// --- map out -----------------------------------------------------------------------------------

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

// --- status ------------------------------------------------------------------------------------

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
  return text_of("no accepted fix for %.1f s", age_s);
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
  result.gps_source = sources.followed();
  return result;
}

void FusionGate::Impl::finish(Output& out, bool status_wanted) {
  follow_healthiest(out);
  const bool due =
      !last_status_ns || to_seconds(now_ns - *last_status_ns) >= config.status_period_s;
  if (status_wanted || verdict_changed || due) {
    out.status = status();
    last_status_ns = now_ns;
    verdict_changed = false;
  }
}

// --- the face ----------------------------------------------------------------------------------

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
  try {
    impl_->frame.emplace(datum);
  } catch (const std::exception& fault) {
    impl_->tell(out, Severity::kError, "datum_refused", fault.what());
    return out;
  }
  impl_->window.clear();
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
  gate.align_pending(out);
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
