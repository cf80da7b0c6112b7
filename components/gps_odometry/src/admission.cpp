// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "admission.hpp"

namespace trigpoint::gps_odometry {

namespace {

bool has_utm(const Datum& datum) {
  return geodesy::to_utm(geodesy::place_of(datum), geodesy::utm_zone_of(datum)).has_value();
}

}  // namespace

Admission::Admission(const Config& config, const RobotConfig& robot)
    : future_limit_ns_(from_seconds(config.future_limit_s)),
      rewind_s_(config.rewind_s),
      clock_(config),
      distance_(config),
      imu_frames_(robot.imu_frame_ids),
      fix_frames_(robot.fix_frame_ids),
      twist_frames_(robot.twist_frame_ids) {}

std::optional<Refusal> Admission::check_frame(Source source, const std::string& frame_id) {
  FrameIds& frames = source == Source::kImu   ? imu_frames_
                     : source == Source::kFix ? fix_frames_
                                              : twist_frames_;
  if (frames.allows(frame_id)) {
    return std::nullopt;
  }
  const std::string reason = source == Source::kImu   ? "imu_unknown_frame"
                             : source == Source::kFix ? "unknown_frame"
                                                      : "twist_unknown_frame";
  return Refusal{reason, frames.is_news(frame_id) ? frames.text(frame_id) : ""};
}

std::optional<Refusal> Admission::check_clock(CheckedFix& fix,
                                              std::optional<Nanoseconds> imu_ns,
                                              Events& events) {
  if (!imu_ns) {
    return std::nullopt;  // refused for that
  }
  const ClockVerdict verdict = clock_.place(fix.stamp_ns, *imu_ns);
  if (verdict.event) {
    events.push_back(*verdict.event);
  }
  if (!verdict.stamp_ns) {
    fixes_ahead_ = verdict.is_ahead ? fixes_ahead_ + 1 : 0;
    return Refusal{verdict.reason, verdict.text};
  }
  fix.stamp_ns = *verdict.stamp_ns;
  fix.stamp_sigma_s = clock_.stamp_sigma_s();
  return std::nullopt;
}

std::optional<Refusal> Admission::check_order(const CheckedFix& fix, const Filter& filter) {
  const auto imu_ns = filter.newest_imu_ns();
  if (!imu_ns) {
    // Its stamp cannot be judged yet.
    return Refusal{"before_imu", "Fix refused: there is no usable IMU sample yet."};
  }
  if (filter.has_fix_at(fix.stamp_ns)) {
    return Refusal{"duplicate_stamp",
                   "Fix refused: there was one with its stamp " +
                       std::to_string(to_seconds(fix.stamp_ns)) + " s already."};
  }
  if (filter.is_too_old(fix.stamp_ns)) {
    const double age_s = to_seconds(*imu_ns - fix.stamp_ns);
    return Refusal{
        "too_old",
        "Fix refused: it is " + std::to_string(age_s) + " s old, " +
            (age_s > rewind_s_ ? "expected at most " + std::to_string(rewind_s_) + " s."
                               : "from before the state to which the filter can go back.")};
  }
  if (fix.stamp_ns > *imu_ns + future_limit_ns_) {
    fixes_ahead_ = fix.stamp_ns > newest_ahead_ns_ ? fixes_ahead_ + 1 : 1;
    newest_ahead_ns_ = fix.stamp_ns;
    return Refusal{"future_stamp",
                   "Fix refused: its stamp is " +
                       std::to_string(to_seconds(fix.stamp_ns - *imu_ns)) +
                       " s ahead of the newest IMU sample, expected at most " +
                       std::to_string(to_seconds(future_limit_ns_)) + " s."};
  }
  return std::nullopt;
}

std::optional<Refusal> Admission::check_place(const CheckedFix& fix,
                                              const geodesy::LocalFrame* frame,
                                              bool has_datum,
                                              Events& events) {
  if (frame == nullptr) {
    return std::nullopt;
  }
  const auto position = frame->to_map(fix.place);
  if (!position) {
    return Refusal{"not_on_map", "Fix refused: the projection has no coordinates for it."};
  }
  if (!has_datum) {
    return std::nullopt;
  }
  const DistanceVerdict verdict = distance_.check(*position);
  if (verdict.refused) {
    return Refusal{"far_from_datum", verdict.text};
  }
  if (!verdict.text.empty()) {
    events.push_back({Severity::kWarning, fix.stamp_ns, "fix_far_from_datum", verdict.text});
  }
  if (const auto doubt = height_reference_.check(fix.stamp_ns, *position)) {
    events.push_back({Severity::kWarning, fix.stamp_ns, "height_reference", *doubt});
  }
  return std::nullopt;
}

std::optional<Refusal> Admission::check_time(const std::string& kind,
                                             Nanoseconds stamp_ns,
                                             const Filter& filter) const {
  const auto imu_ns = filter.newest_imu_ns();
  if (!imu_ns) {
    return Refusal{kind + "_before_imu", "Refused: there is no usable IMU sample yet."};
  }
  if (stamp_ns > *imu_ns + future_limit_ns_) {
    return Refusal{kind + "_future_stamp",
                   "Refused: its stamp is " + std::to_string(to_seconds(stamp_ns - *imu_ns)) +
                       " s ahead of the newest IMU sample."};
  }
  if (filter.is_too_old(stamp_ns)) {
    return Refusal{kind + "_too_old",
                   "Refused: it is " + std::to_string(to_seconds(*imu_ns - stamp_ns)) + " s old."};
  }
  return std::nullopt;
}

Eigen::Matrix3d stamp_covariance_m2(double stamp_sigma_s, const Filter& filter) {
  const Track& track = filter.newest();
  if (track.phase != Phase::kRunning) {
    const double way_m = stamp_sigma_s * track.speed_mps;
    return Eigen::Vector3d(way_m, way_m, 0.0).cwiseAbs2().asDiagonal();
  }
  const Estimate estimate = filter.estimate();
  const Eigen::Vector3d way_m = stamp_sigma_s * (estimate.T_map_base.q * estimate.linear_base_mps);
  return way_m * way_m.transpose();
}

geodesy::LocalFrame make_frame(const Datum& datum, const Config& config) {
  const bool utm = config.projection == "utm" && has_utm(datum);
  return geodesy::LocalFrame(datum, utm ? geodesy::Projection::kUtm : geodesy::Projection::kEnu);
}

std::optional<Event> projection_event(const geodesy::LocalFrame& frame,
                                      const Config& config,
                                      Nanoseconds now_ns) {
  if (config.projection != "utm") {
    return std::nullopt;
  }
  const geodesy::UtmZone zone = geodesy::utm_zone_of(frame.datum());
  const auto utm = geodesy::to_utm(geodesy::place_of(frame.datum()), zone);
  if (!utm) {
    return Event{Severity::kWarning,
                 now_ns,
                 "utm_not_possible",
                 "There is no UTM at the datum: the tangent plane is used."};
  }
  return Event{Severity::kInfo,
               now_ns,
               "utm_projection",
               "UTM zone " + std::to_string(zone.zone) + (zone.north ? "N" : "S") +
                   " by the datum: convergence " + std::to_string(utm->convergence_deg) +
                   " degrees, scale " + std::to_string(utm->scale) + ", both taken out of map."};
}

}  // namespace trigpoint::gps_odometry
