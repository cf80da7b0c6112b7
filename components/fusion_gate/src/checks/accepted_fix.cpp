// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/accepted_fix.hpp"

#include "trigpoint/base/sentence.hpp"

namespace trigpoint::fusion_gate {

const char* name_of(GpsHealth health) {
  switch (health) {
    case GpsHealth::kInit:
      return "init";
    case GpsHealth::kOk:
      return "ok";
    case GpsHealth::kDegraded:
      return "degraded";
    case GpsHealth::kDeadReckoning:
      return "dead_reckoning";
    case GpsHealth::kStale:
      return "stale";
    case GpsHealth::kFault:
      return "fault";
  }
  return "unknown";
}

std::optional<Refusal> check_status(const GpsStatus& status, const std::string& datum_id) {
  if (status.datum_id.empty()) {
    return Refusal{"no_datum", "the GPS source names no datum"};
  }
  if (!datum_id.empty() && status.datum_id != datum_id) {
    return Refusal{"other_datum",
                   "the GPS source uses datum " + status.datum_id + ", ours is " + datum_id};
  }
  // A fix that comes late finds the filter dead reckoning; its age is judged by itself.
  const bool healthy = status.health == GpsHealth::kOk || status.health == GpsHealth::kDegraded ||
                       status.health == GpsHealth::kDeadReckoning;
  if (!healthy) {
    return Refusal{std::string("health_") + name_of(status.health),
                   std::string("health of the GPS source is ") + name_of(status.health)};
  }
  return std::nullopt;
}

std::optional<Refusal> check_values(const AcceptedFix& fix) {
  const Eigen::Vector3d variance_m2 = fix.covariance_map_m2.diagonal();
  if (!fix.antenna_map_m.allFinite() || !fix.covariance_map_m2.allFinite() ||
      !(variance_m2.minCoeff() > 0.0)) {
    return Refusal{"not_finite",
                   "position or covariance of the accepted fix is not finite or not positive"};
  }
  return std::nullopt;
}

std::optional<Refusal> check_age(const AcceptedFix& fix,
                                 std::optional<Nanoseconds> lio_newest_ns,
                                 double max_age_s) {
  const double age_s = lio_newest_ns ? to_seconds(*lio_newest_ns - fix.stamp_ns) : 0.0;
  if (age_s <= max_age_s) {
    return std::nullopt;
  }
  return Refusal{"late", sentence("fix is %.2f s behind LIO, limit %.2f s", age_s, max_age_s)};
}

std::string refused_code(const std::string& reason) {
  return "refused_by_filter_" + reason;
}

}  // namespace trigpoint::fusion_gate
