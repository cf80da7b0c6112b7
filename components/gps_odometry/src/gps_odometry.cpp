// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include "admission.hpp"
#include "aiding.hpp"
#include "counters.hpp"
#include "datum_election.hpp"
#include "filter.hpp"
#include "fix_checks.hpp"
#include "imu_checks.hpp"
#include "status.hpp"
#include "warm_start.hpp"

#include <cmath>
#include <utility>

namespace trigpoint::gps_odometry {

namespace {

constexpr double kFrozenSpeed_mps = 0.5;

}  // namespace

struct GpsOdometry::Impl {
  Impl(const Config& c, const RobotConfig& r)
      : config(c),
        robot(r),
        datum(configured_datum(c)),
        imu_checks(c, robot.q_base_imu()),
        filter(make_filter(c, robot)),
        election(c),
        admission(c, robot) {
    if (datum) {
      frame.emplace(make_frame(*datum, config));
    }
  }

  void take_imu(const ImuSample& sample, Output& output);
  void take_fix(const GnssFix& message, Output& output);
  std::optional<CheckedFix> checked(const GnssFix& message, Output& output);
  bool is_out_of_place(CheckedFix& fix, Nanoseconds stamp_ns, Output& output);
  bool is_refused(const std::optional<Refusal>& refusal, Nanoseconds stamp_ns, Output& output);
  void compare_turns(const MapFix& fix, Output& output);
  template <typename Verdict>
  void take_aiding(const Verdict& verdict,
                   const std::string& kind,
                   Nanoseconds stamp_ns,
                   Output& output);
  void refuse(const std::string& reason,
              const std::string& text,
              Nanoseconds stamp_ns,
              Output& output);
  MapFix place(const CheckedFix& fix) const;
  void elect(const CheckedFix& fix, Output& output);
  void tell_projection(Output& output);
  void move_to(const Datum& new_datum, Output& output);
  void publish_odometry(Output& output);
  void try_warm_start(Output& output);
  Odometry odometry() const;
  void tell_status(Output& output);
  GpsStatus status() const;
  GpsHealth health() const;

  Config config;
  RobotConfig robot;
  std::optional<Datum> datum;
  /// The datum's, or until there is one that of the first fix: heading is searched meanwhile.
  std::optional<geodesy::LocalFrame> frame;
  bool projection_is_news{true};
  ImuChecks imu_checks;
  std::unique_ptr<Filter> filter;
  DatumElection election;
  FrozenReceiver frozen;
  WarmStartListener warm;
  Admission admission;
  Counters counters;
  std::uint64_t fixes_received{0};
  std::uint64_t imu_received{0};
  Nanoseconds now_ns{0};
  std::optional<Nanoseconds> published_ns;
  LastTold last_told;
};

void GpsOdometry::Impl::refuse(const std::string& reason,
                               const std::string& text,
                               Nanoseconds stamp_ns,
                               Output& output) {
  counters.add(reason);
  const bool repaired = reason.starts_with("used_");
  output.events.push_back({repaired ? Severity::kInfo : Severity::kWarning,
                           stamp_ns,
                           (repaired ? "fix_" : "refused_") + reason,
                           text});
}

// ---- IMU ----------------------------------------------------------------------------------------

void GpsOdometry::Impl::take_imu(const ImuSample& sample, Output& output) {
  ++imu_received;
  tell_projection(output);
  if (is_refused(admission.check_frame(Source::kImu, sample.frame_id), sample.stamp_ns, output)) {
    return;
  }
  const ImuVerdict verdict = imu_checks.check(sample);
  if (!verdict.reason.empty()) {
    counters.add(verdict.reason);
    output.events.push_back({Severity::kError, sample.stamp_ns, verdict.reason, verdict.text});
  }
  if (verdict.clock_reset && !filter->bridges_gap_until(sample.stamp_ns)) {
    filter->restart();
    now_ns = sample.stamp_ns;
    published_ns.reset();
    last_told = {};
  }
  if (verdict.sample) {
    election.begin(sample.stamp_ns);
    now_ns = filter->newest_imu_ns() ? std::max(now_ns, sample.stamp_ns) : sample.stamp_ns;
    admission.hear_imu();
    filter->insert(*verdict.sample);
    admission.turns.add_imu(
        sample.stamp_ns, verdict.sample->raw_gyro_radps, verdict.sample->mean_accel_mps2);
    warm.advance(sample.stamp_ns);
    try_warm_start(output);
    publish_odometry(output);
  }
  if (last_told.is_outdated(now_ns, health())) {
    tell_status(output);
  }
}

// ---- fixes --------------------------------------------------------------------------------------

std::optional<CheckedFix> GpsOdometry::Impl::checked(const GnssFix& message, Output& output) {
  if (is_refused(admission.check_frame(Source::kFix, message.frame_id), message.stamp_ns, output)) {
    return std::nullopt;
  }
  GnssFix above_ellipsoid = message;
  above_ellipsoid.altitude_m += robot.geoid_undulation_m;
  FixVerdict verdict = check_fix(above_ellipsoid, config);
  if (!verdict.reason.empty()) {
    refuse(verdict.reason, verdict.text, message.stamp_ns, output);
  }
  if (!verdict.fix || is_out_of_place(*verdict.fix, message.stamp_ns, output)) {
    return std::nullopt;
  }
  const bool moving =
      filter->newest().phase == Phase::kRunning && filter->speed_mps() > kFrozenSpeed_mps;
  if (const auto repeats = frozen.count(verdict.fix->place);
      moving && repeats > config.frozen_fixes) {
    refuse("frozen",
           "Fix refused: the same position came " + std::to_string(repeats) +
               " times in a row while the vehicle moves, expected at most " +
               std::to_string(config.frozen_fixes) + ".",
           message.stamp_ns,
           output);
    return std::nullopt;
  }
  return verdict.fix;
}

/// In time, or on the map.
bool GpsOdometry::Impl::is_out_of_place(CheckedFix& fix, Nanoseconds stamp_ns, Output& output) {
  if (!filter->newest_imu_ns()) {
    now_ns = fix.stamp_ns;
  }
  return is_refused(admission.check_clock(fix, filter->newest_imu_ns(), output.events),
                    stamp_ns,
                    output) ||
         is_refused(admission.check_order(fix, *filter), stamp_ns, output) ||
         is_refused(admission.check_place(
                        fix, frame ? &*frame : nullptr, datum.has_value(), output.events),
                    stamp_ns,
                    output);
}

MapFix GpsOdometry::Impl::place(const CheckedFix& fix) const {
  const Eigen::Matrix3d R = frame->R_map_enu(fix.place);
  MapFix placed{fix,
                frame->to_map(fix.place).value_or(Eigen::Vector3d::Zero()),
                R * fix.covariance_enu_m2 * R.transpose()};
  if (fix.stamp_sigma_s > 0.0) {
    placed.covariance_map_m2 += stamp_covariance_m2(fix.stamp_sigma_s, *filter);
  }
  return placed;
}

void GpsOdometry::Impl::take_fix(const GnssFix& message, Output& output) {
  ++fixes_received;
  if (const auto fix = checked(message, output)) {
    if (!frame) {
      frame.emplace(make_frame(
          Datum{fix->place.latitude_deg, fix->place.longitude_deg, fix->place.height_m, 0},
          config));
    }
    const MapFix placed = place(*fix);
    const FixOutcome outcome = filter->insert(placed);
    if (outcome.reason != "teleport") {
      // What a wrong gyro makes of the filter, the gate would hide.
      compare_turns(placed, output);
    }
    if (!outcome.reason.empty()) {
      // Counted in the Track, because a later rewind may decide otherwise.
      output.events.push_back({outcome.accepted ? Severity::kInfo : Severity::kWarning,
                               fix->stamp_ns,
                               "fix_" + outcome.reason,
                               outcome.text});
    }
    elect(*fix, output);
  }
  tell_status(output);
}

bool GpsOdometry::Impl::is_refused(const std::optional<Refusal>& refusal,
                                   Nanoseconds stamp_ns,
                                   Output& output) {
  if (refusal && refusal->text.empty()) {
    counters.add(refusal->reason);
  } else if (refusal) {
    refuse(refusal->reason, refusal->text, stamp_ns, output);
  }
  return refusal.has_value();
}

void GpsOdometry::Impl::compare_turns(const MapFix& fix, Output& output) {
  const double sigma_m = std::sqrt(fix.covariance_map_m2.diagonal().head<2>().maxCoeff());
  const TurnVerdict verdict =
      admission.turns.add_fix(fix.checked.stamp_ns, fix.antenna_map_m.head<2>(), sigma_m);
  if (!verdict.reason.empty()) {
    imu_checks.condemn(verdict.reason, verdict.text);
    output.events.push_back({Severity::kError, fix.checked.stamp_ns, verdict.reason, verdict.text});
  }
}

template <typename Verdict>
void GpsOdometry::Impl::take_aiding(const Verdict& verdict,
                                    const std::string& kind,
                                    Nanoseconds stamp_ns,
                                    Output& output) {
  if (!verdict.measurement) {
    refuse(verdict.reason, verdict.text, stamp_ns, output);
  } else if (!is_refused(admission.check_time(kind, stamp_ns, *filter), stamp_ns, output)) {
    const FixOutcome outcome = filter->insert(*verdict.measurement);
    if (outcome.reason.starts_with(kind + "_")) {  // others are counted in the Track
      refuse(outcome.reason, outcome.text, stamp_ns, output);
    }
  }
}

// ---- datum --------------------------------------------------------------------------------------

void GpsOdometry::Impl::elect(const CheckedFix& fix, Output& output) {
  if (datum) {
    return;
  }
  if (const auto elected = election.add(fix)) {
    move_to(*elected, output);
    output.elected = elected;
    output.events.push_back({Severity::kInfo,
                             fix.stamp_ns,
                             "datum_elected",
                             "Nobody named a datum: elected " + elected->id() + " from " +
                                 std::to_string(config.datum_fixes) + " fixes."});
  }
}

void GpsOdometry::Impl::move_to(const Datum& new_datum, Output& output) {
  geodesy::LocalFrame new_frame = make_frame(new_datum, config);
  if (frame) {
    const geodesy::Geographic old_origin = geodesy::place_of(frame->datum());
    const Eigen::Matrix3d R = new_frame.R_map_enu(old_origin);
    // Where a grid has ended the tangent plane goes on: the same map.
    const Eigen::Vector3d t =
        new_frame.to_map(old_origin).value_or(*geodesy::LocalFrame(new_datum).to_map(old_origin));
    filter->change_frame(R, t);
    if (datum) {
      filter->announce_reset({std::atan2(R(1, 0), R(0, 0)), t});
    }
  }
  frame = std::move(new_frame);
  datum = new_datum;
  admission.turns.restart();
  projection_is_news = true;
  tell_projection(output);
}

/// Of a configured datum, too: with the first IMU sample.
void GpsOdometry::Impl::tell_projection(Output& output) {
  if (!datum || !std::exchange(projection_is_news, false)) {
    return;
  }
  if (const auto event = projection_event(*frame, config, now_ns)) {
    output.events.push_back(*event);
  }
}

// ---- warm start ---------------------------------------------------------------------------------

void GpsOdometry::Impl::try_warm_start(Output& output) {
  const Track& track = filter->newest();
  if (!warm.is_open() || track.phase == Phase::kRunning) {
    if (!warm.fault.empty()) {
      output.events.push_back(
          {Severity::kWarning,
           track.stamp_ns,
           "no_warm_start",
           "The odometry of another filter was heard, but " + warm.fault + "."});
      warm.fault.clear();
    }
    warm.close();
    return;
  }
  if (!datum || !warm.heard() || track.phase != Phase::kAligning) {
    return;
  }
  const Odometry& heard = warm.heard()->odometry;
  const double age_s = to_seconds(track.stamp_ns - heard.stamp_ns);
  const auto fault = find_warm_start_fault(heard, warm.heard()->datum_id, datum->id());
  const auto state = fault ? std::nullopt : carry_to(heard, track.stamp_ns);
  if (!state) {
    // A better one may come while listening goes on.
    warm.fault = fault.value_or("it is " + std::to_string(age_s) + " s old");
    return;
  }
  const Pose before = filter->estimate().T_map_base;
  filter->warm_start(*state);
  if (track.accepted_ns > 0) {
    filter->announce_reset({yaw_of(state->T_map_base.q), state->T_map_base.p - before.p});
  }
  warm.close();
  warm.fault.clear();
  output.events.push_back({Severity::kInfo,
                           track.stamp_ns,
                           "warm_start",
                           "Begun from another filter's odometry, " + std::to_string(age_s) +
                               " s old; heading sigma " + std::to_string(filter->yaw_sigma_rad()) +
                               " rad."});
}

// ---- output -------------------------------------------------------------------------------------

Odometry GpsOdometry::Impl::odometry() const {
  const Estimate estimate = filter->estimate();
  Odometry odometry;
  odometry.stamp_ns = filter->newest().stamp_ns;
  odometry.frame_id = "map";
  odometry.child_frame_id = "base_link";
  odometry.T_frame_child = estimate.T_map_base;
  odometry.pose_covariance = estimate.pose_covariance;
  odometry.linear_mps = estimate.linear_base_mps;
  odometry.angular_radps = estimate.angular_base_radps;
  odometry.twist_covariance = estimate.twist_covariance;
  return odometry;
}

void GpsOdometry::Impl::publish_odometry(Output& output) {
  const Track& track = filter->newest();
  if (!datum || track.phase == Phase::kNoImu ||
      (track.accepted_ns == 0 && !is_unconfirmed(track))) {
    return;
  }
  // A tenth of a period of tolerance: stamps of a 100 Hz IMU jitter.
  const Nanoseconds period_ns = from_seconds(0.9 / config.publish_rate_hz);
  if (published_ns && track.stamp_ns - *published_ns < period_ns) {
    return;
  }
  Odometry candidate = odometry();
  if (!candidate.T_frame_child.is_finite() || !candidate.pose_covariance.allFinite()) {
    counters.add("output_not_finite");
    return;
  }
  published_ns = track.stamp_ns;
  output.odometry = std::move(candidate);
}

GpsHealth GpsOdometry::Impl::health() const {
  const Surroundings around{now_ns,
                            datum.has_value(),
                            imu_checks.is_faulty(),
                            admission.imu_is_silent(),
                            filter->is_doubtful()};
  return health_of(filter->newest(), filter->yaw_sigma_rad(), around, config);
}

void GpsOdometry::Impl::tell_status(Output& output) {
  output.status = status();
  last_told = {now_ns, output.status->health};
}

GpsStatus GpsOdometry::Impl::status() const {
  const Track& track = filter->newest();
  GpsStatus status;
  status.stamp_ns = now_ns;
  status.source = filter->source();
  status.health = health();
  status.datum_id = datum ? datum->id() : "";
  status.gnss_class = track.gnss_class;
  if (datum) {
    status.last_accepted_fix_ns = track.accepted_ns;
    status.accepted_antenna_map_m = track.accepted_antenna_map_m;
    status.accepted_covariance_map_m2 = track.accepted_covariance_map_m2;
    status.recent_fixes = filter->recent_fixes();
  }
  status.test_ratio = track.test_ratio;
  status.fixes_received = fixes_received;
  status.fixes_accepted = track.accepted;
  status.rejections = rejections_of(track, counters);
  status.imu_received = imu_received;
  status.reset = track.reset;
  return status;
}

// ---- the face -----------------------------------------------------------------------------------

GpsOdometry::GpsOdometry(const Config& config, const RobotConfig& robot)
    : impl_(std::make_unique<Impl>(config, robot)) {}

GpsOdometry::~GpsOdometry() = default;

Output GpsOdometry::on_imu(const ImuSample& sample) {
  Output output;
  impl_->take_imu(sample, output);
  return output;
}

Output GpsOdometry::on_fix(const GnssFix& fix) {
  Output output;
  impl_->take_fix(fix, output);
  return output;
}

Output GpsOdometry::on_twist(const TwistMeasurement& twist) {
  Output output;
  Impl& impl = *impl_;
  const auto refusal = impl.admission.check_frame(Source::kTwist, twist.frame_id);
  if (!impl.is_refused(refusal, twist.stamp_ns, output)) {
    impl.take_aiding(check_twist(twist, impl.config), "twist", twist.stamp_ns, output);
  }
  return output;
}

Output GpsOdometry::on_yaw(const YawMeasurement& yaw) {
  Output output;
  impl_->take_aiding(check_heading(yaw, impl_->robot), "yaw", yaw.stamp_ns, output);
  return output;
}

Output GpsOdometry::on_datum(const Datum& candidate) {
  Output output;
  Impl& impl = *impl_;
  if (const auto fault = geodesy::find_fault(geodesy::place_of(candidate))) {
    impl.refuse("datum_not_a_place", "Datum refused: " + *fault + ".", impl.now_ns, output);
    return output;
  }
  if (!impl.datum) {
    impl.move_to(candidate, output);
    output.events.push_back({Severity::kInfo,
                             impl.now_ns,
                             "datum_adopted",
                             "Adopted the datum " + candidate.id() + "."});
  } else if (candidate.id() != impl.datum->id()) {
    const bool adopts = wins(candidate, *impl.datum);
    const std::string kept = adopts ? candidate.id() : impl.datum->id();
    const std::string dropped = adopts ? impl.datum->id() : candidate.id();
    output.events.push_back(
        {Severity::kError,
         impl.now_ns,
         "datum_conflict",
         "Two data were elected: the older, " + kept + ", holds; " + dropped + " is dropped."});
    if (adopts) {
      impl.move_to(candidate, output);
    }
  }
  return output;
}

Output GpsOdometry::on_odometry(const Odometry& odometry, const std::string& datum_id) {
  Output output;
  impl_->warm.hear(odometry, datum_id);
  return output;
}

bool GpsOdometry::wants_odometry() const {
  return impl_->warm.is_open();
}

std::optional<Datum> GpsOdometry::datum() const {
  return impl_->datum;
}

GpsStatus GpsOdometry::status() const {
  return impl_->status();
}

}  // namespace trigpoint::gps_odometry
