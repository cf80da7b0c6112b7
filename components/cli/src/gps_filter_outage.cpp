// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gps_filter_judges.hpp"

#include <array>
#include <optional>

namespace trigpoint::cli {

namespace {

constexpr double kSeesOutageWithin_s = 3.0;
constexpr double kRecoversWithin_s = 5.0;
constexpr double kRecoveredSigma_m = 1.0;
constexpr double kGrowth = 2.0;

const char* name_of(GpsHealth health) {
  constexpr std::array<const char*, 6> kNames{
      "INIT", "OK", "DEGRADED", "DEAD_RECKONING", "STALE", "FAULT"};
  return kNames.at(static_cast<std::size_t>(health));
}

class OutageJudge {
 public:
  OutageJudge(const FilterDrive& drive, ContractChecks& checks)
      : drive_(drive), record_(drive.record), script_(drive.script), checks_(checks) {}

  void run() {
    status_counts();
    health();
    growth();
    recovery();
  }

 private:
  void add(const std::string& name, bool passed, const std::string& figures) {
    checks_.push_back({name, passed, figures});
  }

  void status_counts() {
    const GpsStatus& last = record_.statuses.back().message;
    std::size_t back = 0;
    for (std::size_t i = 1; i < record_.statuses.size(); ++i) {
      const GpsStatus& a = record_.statuses[i - 1].message;
      const GpsStatus& b = record_.statuses[i].message;
      back += b.fixes_received < a.fixes_received || b.fixes_accepted < a.fixes_accepted ||
                      b.last_accepted_fix_ns < a.last_accepted_fix_ns
                  ? 1
                  : 0;
    }
    add("status counts",
        back == 0 && last.fixes_received >= record_.fixes && !last.source.empty(),
        text("'%s' received %llu of %llu fixes, accepted %llu; counters went back %zu times",
             last.source.c_str(),
             static_cast<unsigned long long>(last.fixes_received),
             static_cast<unsigned long long>(record_.fixes),
             static_cast<unsigned long long>(last.fixes_accepted),
             back));
  }

  void health() {
    bool ok_before = false;
    std::size_t blind = 0;  // status messages that do not see the outage
    std::optional<GpsHealth> end;
    std::string course;
    std::optional<GpsHealth> last;
    for (const auto& heard : record_.statuses) {
      const GpsHealth now = heard.message.health;
      if (!last || *last != now) {
        course += std::string(course.empty() ? "" : " ") + name_of(now);
      }
      last = now;
      const bool reckons = now == GpsHealth::kDeadReckoning || now == GpsHealth::kStale;
      if (heard.reached_ns < script_.outage_from_ns) {
        ok_before = ok_before || now == GpsHealth::kOk;
      } else if (drive_.in_outage(heard.reached_ns, kSeesOutageWithin_s)) {
        blind += reckons && heard.message.last_accepted_fix_ns <= script_.outage_from_ns ? 0 : 1;
        end = now;
      }
    }
    const bool first_init = record_.statuses.front().message.health == GpsHealth::kInit;
    add("health before the outage",
        ok_before && first_init,
        text("%s, and %s",
             first_init ? "INIT at first" : "not INIT at first",
             ok_before ? "OK was reached" : "OK was never reached"));
    add("health in the outage",
        end && blind == 0,
        text("%zu status messages later than %.0f s into it do not say DEAD_RECKONING or STALE",
             blind,
             kSeesOutageWithin_s));
    const bool back = last == GpsHealth::kOk || last == GpsHealth::kDegraded;
    add("health after the outage", back, course.substr(0, 200));
  }

  void growth() {
    double before_m = kNaN;
    double middle_m = kNaN;
    double end_m = kNaN;
    std::size_t in_it = 0;
    const Nanoseconds middle_ns =
        script_.outage_from_ns + (script_.outage_to_ns - script_.outage_from_ns) / 2;
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      if (o.stamp_ns <= script_.outage_from_ns) {
        before_m = sigma_m(o);
      } else if (drive_.in_outage(o.stamp_ns)) {
        middle_m = o.stamp_ns < middle_ns ? sigma_m(o) : middle_m;
        end_m = sigma_m(o);
        in_it += drive_.in_outage(o.stamp_ns, kSeesOutageWithin_s) ? 1 : 0;
      }
    }
    if (in_it == 0) {
      add("sigma grows in the outage", true, "no gps/odometry in it: nothing is claimed");
      return;
    }
    add("sigma grows in the outage",
        end_m > kGrowth * before_m && end_m >= middle_m,
        text("%.3f m before, %.3f m in its middle, %.3f m at its end (at least %.0f times)",
             before_m,
             middle_m,
             end_m,
             kGrowth));
  }

  void recovery() {
    const Nanoseconds limit_ns = script_.outage_to_ns + from_seconds(kRecoversWithin_s);
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      const bool heard_of_fixes = accepted_after_outage(heard.reached_ns);
      if (o.stamp_ns > script_.outage_to_ns && heard_of_fixes && sigma_m(o) < kRecoveredSigma_m) {
        add("recovery after the outage",
            o.stamp_ns < limit_ns,
            text("sigma below %.1f m with accepted fixes %.2f s after its end (at most %.0f)",
                 kRecoveredSigma_m,
                 to_seconds(o.stamp_ns - script_.outage_to_ns),
                 kRecoversWithin_s));
        return;
      }
    }
    add("recovery after the outage", false, "no certain position came after it");
  }

  bool accepted_after_outage(Nanoseconds reached_ns) const {
    return std::any_of(record_.statuses.begin(), record_.statuses.end(), [&](const auto& heard) {
      return heard.reached_ns <= reached_ns &&
             heard.message.last_accepted_fix_ns >= script_.outage_to_ns;
    });
  }

  const FilterDrive& drive_;
  const recording::FilterRecord& record_;
  const FilterScript& script_;
  ContractChecks& checks_;
};

}  // namespace

void judge_outage(const FilterDrive& drive, ContractChecks& checks) {
  if (drive.record.statuses.empty()) {
    checks.push_back(
        {"status", false, "no gps/status came: the gate would take it for a foreign filter"});
  } else if (!drive.record.odometry.empty()) {
    OutageJudge(drive, checks).run();
  }
}

}  // namespace trigpoint::cli
