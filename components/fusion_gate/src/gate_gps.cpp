// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/rejections.hpp"
#include "trigpoint/base/sentence.hpp"

#include "gate.hpp"

#include <algorithm>
#include <map>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::size_t kMaxWaitingFixes = 64;
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

std::string refused_sentence(const GpsStatus& gps, const std::string& reason) {
  return "refused by " + gps.source + ": " + reason;
}

/// A filter that keeps no records tells of its newest accepted fix only.
std::vector<ToldFix> told_fixes(const GpsStatus& gps) {
  std::vector<ToldFix> told;
  for (const FixRecord& record : gps.recent_fixes) {
    const AcceptedFix fix{record.stamp_ns, record.antenna_map_m, record.covariance_map_m2, true};
    const Refusal refusal{refused_code(record.reason), refused_sentence(gps, record.reason)};
    told.push_back({fix, record.accepted ? std::nullopt : std::optional(refusal), std::nullopt});
  }
  if (told.empty() && gps.last_accepted_fix_ns != 0) {
    told.push_back(
        {{gps.last_accepted_fix_ns, gps.accepted_antenna_map_m, gps.accepted_covariance_map_m2},
         std::nullopt,
         std::nullopt});
  }
  return told;
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
  if (out.selected) {
    remember_gps(*out.selected);
  }
  if (out.selected && sources.find(writer)->status && !aligned()) {
    hear_heading_of(*out.selected);
  }
  for (const AcceptedFix& fix : ready) {
    tell_of({fix, std::nullopt, std::nullopt}, out);
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
  settle_others(gps, before, take_records(gps, before, out));
}

/// Fixes that the filter has received since its last status and that this gate has seen come.
std::uint64_t FusionGate::Impl::open_fixes(const GpsStatus& gps,
                                           const std::optional<GpsStatus>& last) const {
  if (!last) {
    // What the filter had received before this gate began is nobody's business here.
    return std::min(gps.fixes_received, growth(fixes_seen, verdicts.total()));
  }
  const bool began_anew = gps.fixes_received < last->fixes_received;
  return growth(gps.fixes_received, began_anew ? 0 : last->fixes_received);
}

FusionGate::Impl::Told FusionGate::Impl::take_records(const GpsStatus& gps,
                                                      const std::optional<GpsStatus>& last,
                                                      Output& out) {
  std::vector<ToldFix> all = told_fixes(gps);
  const std::size_t wanted = std::max<std::size_t>(1, open_fixes(gps, last));
  if (!last && all.size() > wanted) {
    const auto first_wanted = all.end() - static_cast<std::ptrdiff_t>(wanted);
    for (auto one = all.begin(); one != first_wanted; ++one) {
      verdicts.remember(one->fix.stamp_ns);  // the next status tells of it again
    }
    all.erase(all.begin(), first_wanted);
  }
  const bool repeats =
      gps.recent_fixes.empty() && last && gps.last_accepted_fix_ns == last->last_accepted_fix_ns;
  Told told;
  for (ToldFix& one : repeats ? std::vector<ToldFix>{} : all) {
    one.fault = one.refused_by_filter ? std::nullopt : check_status(gps, datum_id());
    if (tell_of(one, out)) {
      ++told.fixes;
      if (one.refused_by_filter) {
        ++told.refused[one.refused_by_filter->code];
      }
    }
  }
  return told;
}

/// `retold` fixes are told of again, now that they have a place in map: what became of them before
/// is undone. Of `refusals`, by reason, since the status before, nobody has heard yet.
void FusionGate::Impl::take_back_retold(const Told& told,
                                        std::uint64_t retold,
                                        const std::map<std::string, std::uint64_t>& refusals) {
  for (const auto& [code, count] : told.refused) {
    const auto is_of_code = [&code = code](const auto& one) {
      return refused_code(one.first) == code;
    };
    const auto of_now = std::find_if(refusals.begin(), refusals.end(), is_of_code);
    std::uint64_t again =
        std::min(retold, growth(count, of_now == refusals.end() ? 0 : of_now->second));
    retold -= again;
    for (; again > 0; --again) {
      verdicts.take_back(code);
    }
  }
  for (; retold > 0; --retold) {
    verdicts.take_back(kBeforeDatum);
  }
}

/// Fixes without a record get their verdict here, so that every fix has exactly one: messages that
/// the filter refused as such, by reason; and of a filter that keeps no records all that it
/// refused, and what it accepted behind a newer fix.
void FusionGate::Impl::settle_others(const GpsStatus& gps,
                                     const std::optional<GpsStatus>& last,
                                     const Told& told) {
  const bool began_anew = last && gps.fixes_received < last->fixes_received;
  const GpsStatus before = last && !began_anew ? *last : GpsStatus{};
  std::uint64_t open = open_fixes(gps, last);
  const auto settle = [&](std::uint64_t count, const std::string& code, const std::string& why) {
    for (; count > 0 && open > 0; --count, --open) {
      verdicts.record(gps.stamp_ns, false, code, why);
      status_is_news = true;
    }
  };
  const std::uint64_t of_now = std::min(open, told.fixes);
  open -= of_now;
  const auto refusals = new_refusals(gps, before);
  if (before.datum_id.empty()) {
    take_back_retold(told, told.fixes - of_now, refusals);
  }
  for (const auto& [reason, count] : refusals) {
    const auto recorded = told.refused.find(refused_code(reason));
    settle(growth(count, recorded == told.refused.end() ? 0 : recorded->second),
           refused_code(reason),
           refused_sentence(gps, reason));
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
  status_is_news = true;
  queue.hear(fix.stamp_ns, now_ns);
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
        tell_of({accepted, std::nullopt, std::nullopt}, out);
      }
    }
  }
}

ForeignSource& FusionGate::Impl::foreign(const std::string& writer) {
  return foreign_sources.try_emplace(writer, config, robot.antenna_position_base_m).first->second;
}

/// True when nobody had told of the fix yet. What is held of one that waits is brought up to date.
bool FusionGate::Impl::tell_of(ToldFix told, Output& out) {
  const Nanoseconds stamp_ns = told.fix.stamp_ns;
  if (!told.refused_by_filter && !told.fault) {
    told.fault = check_values(told.fix);
  }
  if (const ToldFix* known = queue.find(stamp_ns)) {
    if (!told.refusal() && known->refusal()) {
      note_accepted(told.fix);
    }
    queue.put(told);
    return false;
  }
  if (!verdicts.is_new(stamp_ns)) {
    return false;
  }
  std::optional<Refusal> late;
  if (FixQueue::is_far_ahead(stamp_ns, now_ns)) {
    late = told.refusal().value_or(
        Refusal{"from_the_future",
                sentence("its stamp is %.1f s ahead of data time", to_seconds(stamp_ns - now_ns))});
  } else if (!told.refusal()) {
    late = check_age(told.fix, last_lio_ns, config.max_fix_age_s);
    if (!late && mode == Mode::kSmooth && queue.is_overtaken(stamp_ns)) {
      late = Refusal{"behind_newer_fix", "a newer fix was judged already"};
    }
  }
  if (late) {
    status_is_news = true;
    verdicts.record(stamp_ns, false, late->code, late->reason);
    tell(out, Severity::kWarning, "fix_refused", late->reason);
    return true;
  }
  if (!told.refusal()) {
    note_accepted(told.fix);
  }
  queue.put(told);
  if (queue.waiting().size() > kMaxWaitingFixes) {
    record_unjudged(queue.take(), {"no_lio_pose", "LIO never covered the fix's stamp"});
  }
  return true;
}

/// The verdict of a fix that leaves the queue by force: what it was refused for already, if
/// anything.
void FusionGate::Impl::record_unjudged(const ToldFix& told, const Refusal& otherwise) {
  const Refusal why = told.refusal().value_or(otherwise);
  verdicts.record(told.fix.stamp_ns, false, why.code, why.reason);
  status_is_news = true;
}

void FusionGate::Impl::refuse_waiting(const Refusal& why) {
  for (const ToldFix& told : queue.waiting()) {
    record_unjudged(told, why);
  }
  queue.clear_waiting();
}

void FusionGate::Impl::note_accepted(const AcceptedFix& fix) {
  constexpr std::size_t kIntervals = 5;
  if (last_accepted_ns && fix.stamp_ns > *last_accepted_ns) {
    fix_intervals_s.push_back(to_seconds(fix.stamp_ns - *last_accepted_ns));
  }
  if (fix_intervals_s.size() > kIntervals) {
    fix_intervals_s.pop_front();
  }
  last_accepted_ns = std::max(last_accepted_ns.value_or(fix.stamp_ns), fix.stamp_ns);
}

/// Whether the followed filter's fixes are in this datum.
bool FusionGate::Impl::names_datum(const std::string& id) const {
  const GpsSource* source = sources.followed_source();
  return source != nullptr && source->status && source->status->datum_id == id;
}

void FusionGate::Impl::follow_healthiest(Output& out) {
  if (!sources.select(now_ns)) {
    return;
  }
  status_is_news = true;
  const std::string& writer = sources.followed();
  tell(out,
       writer.empty() ? Severity::kWarning : Severity::kInfo,
       "gps_source",
       writer.empty() ? "no GPS source is heard" : "GPS source followed from now on: " + writer);
}

}  // namespace trigpoint::fusion_gate
