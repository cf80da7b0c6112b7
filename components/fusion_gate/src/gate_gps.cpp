// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/rejections.hpp"

#include "gate.hpp"

#include <algorithm>
#include <map>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::size_t kMaxPendingFixes = 64;
constexpr const char* kBeforeDatum = "before_datum";

/// Fixes that were newly refused, by reason.
std::map<std::string, std::uint64_t> new_refusals(const GpsStatus& now, const GpsStatus& before) {
  const auto old = rejections_of_kind(before.rejections, RejectionKind::kFixRefused);
  std::map<std::string, std::uint64_t> result;
  for (const auto& [reason, count] :
       rejections_of_kind(now.rejections, RejectionKind::kFixRefused)) {
    const auto found = old.find(reason);
    const std::uint64_t known = found == old.end() ? 0 : found->second;
    if (count > known) {
      result[reason] = count - known;
    }
  }
  return result;
}

std::uint64_t growth(std::uint64_t now, std::uint64_t before) {
  return now > before ? now - before : 0;
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
  const bool told_of_a_fix = gps.last_accepted_fix_ns != 0 &&
                             (!before || gps.last_accepted_fix_ns != before->last_accepted_fix_ns);
  settle_others(gps, before, told_of_a_fix);
  if (told_of_a_fix) {
    judge({gps.last_accepted_fix_ns, gps.accepted_antenna_map_m, gps.accepted_covariance_map_m2},
          check_status(gps, datum_id()),
          out);
  }
}

/// A status speaks of the newest accepted fix only. The others that the filter has received since
/// its last one get their verdict here, so that every fix has exactly one: refused ones by reason,
/// and accepted ones that came behind a newer fix (late ones overtake each other).
void FusionGate::Impl::settle_others(const GpsStatus& gps,
                                     const std::optional<GpsStatus>& last,
                                     bool told_of_a_fix) {
  const bool began_anew = last && gps.fixes_received < last->fixes_received;
  const GpsStatus before = last && !began_anew ? *last : GpsStatus{};
  std::uint64_t open = growth(gps.fixes_received, before.fixes_received);
  if (!last) {
    // What the filter had received before this gate began is nobody's business here.
    open = std::min(open, growth(fixes_seen, verdicts.total()));
  }
  const auto settle = [&](std::uint64_t count, const std::string& code, const std::string& why) {
    for (; count > 0 && open > 0; --count, --open) {
      verdicts.record(gps.stamp_ns, false, code, why);
      verdict_changed = true;
    }
  };
  for (const auto& [reason, count] : new_refusals(gps, before)) {
    settle(count, "refused_by_filter_" + reason, "refused by " + gps.source + ": " + reason);
  }
  if (told_of_a_fix && open > 0) {
    --open;  // gets its own verdict
  } else if (told_of_a_fix && verdicts.is_known(kBeforeDatum) &&
             !verdicts.is_judged(gps.last_accepted_fix_ns)) {
    verdicts.take_back(kBeforeDatum);  // told of again, now that it has a place in map
  }
  const std::uint64_t accepted = growth(gps.fixes_accepted, before.fixes_accepted);
  if (gps.datum_id.empty()) {
    settle(accepted, kBeforeDatum, "accepted by " + gps.source + " before there was a datum");
  }
  settle(std::min(accepted, open),
         "behind_newer_fix",
         "accepted by " + gps.source + " behind a newer fix: its row would come too late");
  settle(
      open, "refused_by_filter_no_reason_given", "refused by " + gps.source + " without a reason");
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
  const auto position =
      (wanted || mode == Mode::kSmooth) && usable ? frame->to_map(place) : std::nullopt;
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
  remember_raw({fix.stamp_ns,
                *position,
                covariance_m2 * config.smooth.raw_sigma_scale * config.smooth.raw_sigma_scale});
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
  if (aligned() && mode != Mode::kSmooth) {
    make_rows(fix, out);
    return;
  }
  const auto later = std::upper_bound(
      pending.begin(), pending.end(), fix, [](const AcceptedFix& a, const AcceptedFix& b) {
        return a.stamp_ns < b.stamp_ns;
      });
  pending.insert(later, fix);
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
