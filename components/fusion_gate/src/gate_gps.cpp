// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gate.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::size_t kMaxPendingFixes = 64;

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
  const geodesy::Geographic place{
      fix.latitude_deg, fix.longitude_deg, fix.altitude_m + robot.geoid_undulation_m};
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

}  // namespace trigpoint::fusion_gate
