// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What fixes are worth in eskf18: their scatter about the strapdown's way.
#include "ins_tracker.hpp"

namespace trigpoint::gps_odometry {

/// Of the fixes before this one: how far each is apart from it, beyond the strapdown's way. Where
/// two headings are kept the course of both is that of the fixes.
void InsTracker::watch_scatter(InsTrack& track, const MapFix& fix) const {
  auto& [before, last] = track.lately;
  if (track.phase != Phase::kRunning) {
    before = last = FixOnTheWay{};
    return;
  }
  const Eigen::Vector3d step_m = antenna(track.filter, lever_base_m_) - last.antenna_map_m;
  before.way_m += step_m;
  last.way_m += step_m;
  const auto is_near = [&](const FixOnTheWay& other) {
    const double passed_s = to_seconds(fix.checked.stamp_ns - other.stamp_ns);
    return other.stamp_ns != 0 && passed_s > 0.0 && passed_s <= config_.eskf18.suspect_outage_s;
  };
  if (!is_near(last) || !is_near(before)) {
    return;
  }
  const auto ratio_with = [&](const FixOnTheWay& other, Part part) {
    const double passed_s = to_seconds(fix.checked.stamp_ns - other.stamp_ns);
    double apart_m2 = 0.0;
    double way_m2 = 0.0;
    double said_m2 = 0.0;
    for (int i = kSpans[part].first; i < kSpans[part].first + kSpans[part].count; ++i) {
      const double apart_m = fix.antenna_map_m(i) - other.fix_map_m(i) - other.way_m(i);
      apart_m2 += apart_m * apart_m;
      way_m2 += passed_s * passed_s * track.filter.P(ins::kVelocity + i, ins::kVelocity + i);
      said_m2 += other.said_m2(i) + config_.eskf18.fix_white_share * fix.covariance_map_m2(i, i);
    }
    return FixScatter::ratio(apart_m2, way_m2, said_m2);
  };
  for (const Part part : kParts) {
    track.scatter[part].add(ratio_with(last, part), ratio_with(before, part));
  }
}

/// The fix with as much more white variance as the receiver's newest ones scatter.
MapFix InsTracker::as_it_scatters(const InsTrack& track, const MapFix& fix) const {
  MapFix weighed = fix;
  const double level = track.scatter[kHorizontal].factor(kSpans[kHorizontal].count) - 1.0;
  const double height = track.scatter[kVertical].factor(kSpans[kVertical].count) - 1.0;
  weighed.added_white_m2 =
      config_.eskf18.fix_white_share *
      Eigen::Vector3d(level, level, height).cwiseProduct(fix.covariance_map_m2.diagonal());
  return weighed;
}

/// The next fixes are held against this one.
void InsTracker::keep_on_the_way(InsTrack& track, const MapFix& fix) const {
  track.lately[0] = track.lately[1];
  track.lately[1] = {fix.checked.stamp_ns,
                     fix.antenna_map_m,
                     antenna(track.filter, lever_base_m_),
                     Eigen::Vector3d::Zero(),
                     config_.eskf18.fix_white_share * fix.covariance_map_m2.diagonal()};
}

}  // namespace trigpoint::gps_odometry
