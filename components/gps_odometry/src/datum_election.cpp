// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "datum_election.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

constexpr double kMargin_m = 5.0;

/// Whether two fixes can belong to one vehicle.
bool agree(const CheckedFix& first, const CheckedFix& second, double highest_speed_mps) {
  const geodesy::LocalFrame frame(
      Datum{first.place.latitude_deg, first.place.longitude_deg, first.place.height_m, 0});
  const auto step = frame.to_map(second.place);
  const double elapsed_s = std::abs(to_seconds(second.stamp_ns - first.stamp_ns));
  const double variance = first.covariance_enu_m2.diagonal().maxCoeff() +
                          second.covariance_enu_m2.diagonal().maxCoeff();
  return step &&
         step->norm() < highest_speed_mps * elapsed_s + kMargin_m + 3.0 * std::sqrt(variance);
}

}  // namespace

std::optional<Datum> configured_datum(const Config& config) {
  if (!config.use_configured_datum) {
    return std::nullopt;
  }
  const Datum datum{
      config.datum_latitude_deg, config.datum_longitude_deg, config.datum_height_m, 0};
  if (const auto fault = geodesy::find_fault(geodesy::place_of(datum))) {
    throw ConfigError("gps_odometry: the datum is not a place: " + *fault + ".");
  }
  return datum;
}

bool wins(const Datum& candidate, const Datum& present) {
  if (candidate.elected_ns != present.elected_ns) {
    return candidate.elected_ns < present.elected_ns;
  }
  return candidate.id() < present.id();
}

DatumElection::DatumElection(const Config& config)
    : wait_ns_(from_seconds(config.datum_wait_s)),
      fixes_(static_cast<std::size_t>(config.datum_fixes)),
      highest_speed_mps_(config.highest_speed_mps) {}

void DatumElection::begin(Nanoseconds stamp_ns) {
  if (!began_ns_) {
    began_ns_ = stamp_ns;
  }
}

std::optional<Datum> DatumElection::add(const CheckedFix& fix) {
  begin(fix.stamp_ns);
  if (!candidates_.empty() && !agree(candidates_.back(), fix, highest_speed_mps_)) {
    candidates_.clear();  // one of the two is wrong: start over rather than guess
  }
  if (candidates_.size() < fixes_) {
    candidates_.push_back(fix);
  }
  if (candidates_.size() < fixes_ || fix.stamp_ns - *began_ns_ < wait_ns_) {
    return std::nullopt;
  }
  // In a local frame: longitudes cannot be averaged across the antimeridian.
  const geodesy::Geographic& origin = candidates_.front().place;
  const geodesy::LocalFrame frame(
      Datum{origin.latitude_deg, origin.longitude_deg, origin.height_m, 0});
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const CheckedFix& candidate : candidates_) {
    sum += frame.to_map(candidate.place).value_or(Eigen::Vector3d::Zero());
  }
  const geodesy::Geographic mean =
      frame.to_geographic(sum / static_cast<double>(candidates_.size()));
  return Datum{mean.latitude_deg, mean.longitude_deg, mean.height_m, fix.stamp_ns};
}

}  // namespace trigpoint::gps_odometry
