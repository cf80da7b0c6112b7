// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "status.hpp"

#include <algorithm>

namespace trigpoint::gps_odometry {

namespace {

// After a reset or a refusal, consumers are told for this long that all was not well.
constexpr double kRecently_s = 2.0;
constexpr double kIntervals = 2.5;

bool is_recent(Nanoseconds stamp_ns, Nanoseconds now_ns) {
  return stamp_ns > 0 && to_seconds(now_ns - stamp_ns) < kRecently_s;
}

}  // namespace

double dead_reckoning_age_s(const Track& track, const Config& config) {
  return std::max(config.dead_reckoning_after_s, kIntervals * track.fix_interval_s);
}

GpsHealth health_of(const Track& track,
                    double yaw_sigma_rad,
                    const Surroundings& around,
                    const Config& config) {
  if (around.imu_faulty) {
    return GpsHealth::kFault;
  }
  if (!around.has_datum || track.phase == Phase::kNoImu ||
      (track.accepted_ns == 0 && !is_unconfirmed(track))) {
    return GpsHealth::kInit;
  }
  const double age_s = to_seconds(around.now_ns - std::max(track.accepted_ns, track.warm_ns));
  if (around.imu_silent || age_s > config.stale_after_s) {
    return GpsHealth::kStale;
  }
  if (age_s > dead_reckoning_age_s(track, config)) {
    return GpsHealth::kDeadReckoning;
  }
  const bool doubtful = track.assumed_covariance || is_recent(track.refused_ns, around.now_ns) ||
                        is_recent(track.reset_ns, around.now_ns) || around.filter_doubts;
  if (doubtful || yaw_sigma_rad > config.heading_converged_rad) {
    return GpsHealth::kDegraded;
  }
  return GpsHealth::kOk;
}

std::vector<NamedCount> rejections_of(const Track& track, const Counters& messages) {
  std::vector<NamedCount> counts = messages.list();
  const auto add = [&](const char* name, std::uint64_t count) {
    if (count > 0) {
      counts.push_back({name, count});
    }
  };
  add("before_imu", track.refused_before_imu);
  add("gate", track.refused_gate);
  add("teleport", track.refused_teleport);
  add("used_without_height", track.used_without_height);
  add("recovered", track.recoveries);
  add("state_not_finite", track.not_finite);
  add("covariance_restored", track.restored);
  add("twist_gate", track.twists_refused);
  add("yaw_gate", track.yaws_refused);
  add("yaw_contradicted", track.yaws_contradicted);
  std::sort(counts.begin(), counts.end(), [](const NamedCount& a, const NamedCount& b) {
    return a.name < b.name;
  });
  return counts;
}

}  // namespace trigpoint::gps_odometry
