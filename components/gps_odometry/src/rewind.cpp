// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rewind.hpp"

#include <algorithm>
#include <iterator>

namespace trigpoint::gps_odometry {

RewindBuffer::RewindBuffer(const Tracker& tracker, Nanoseconds length_ns)
    : tracker_(tracker), length_ns_(length_ns) {}

void RewindBuffer::insert(const CheckedImu& imu) {
  newest_imu_ns_ = imu.stamp_ns;
  insert(imu.stamp_ns, imu);
  forget_old();
}

FixOutcome RewindBuffer::insert(const MapFix& fix) {
  const FixOutcome outcome = insert(fix.checked.stamp_ns, fix);
  forget_old();
  return outcome;
}

FixOutcome RewindBuffer::insert(Nanoseconds stamp_ns, const Measurement& measurement) {
  const auto is_before = [&](const Entry& entry) {
    return entry.stamp_ns < stamp_ns ||
           (entry.stamp_ns == stamp_ns && entry.measurement.index() <= measurement.index());
  };
  // From the end: nearly everything comes in order.
  auto place = entries_.end();
  while (place != entries_.begin() && !is_before(*std::prev(place))) {
    --place;
  }
  place = entries_.insert(place, Entry{stamp_ns, measurement, Track{}});
  const auto before = [&](auto it) -> const Track& {
    return it == entries_.begin() ? before_ : std::prev(it)->after;
  };
  const FixOutcome outcome = apply(*place, before(place));
  for (auto it = std::next(place); it != entries_.end(); ++it) {
    apply(*it, before(it));
  }
  return outcome;
}

FixOutcome RewindBuffer::apply(Entry& entry, const Track& before) const {
  entry.after = before;
  FixOutcome outcome;
  if (const auto* imu = std::get_if<CheckedImu>(&entry.measurement)) {
    tracker_.apply(entry.after, *imu);
  } else {
    outcome = tracker_.apply(entry.after, std::get<MapFix>(entry.measurement));
  }
  if (!entry.after.filter.is_finite()) {
    // Cannot be, and must not spread if it is: start again from the next sample.
    entry.after = before;
    entry.after.phase = Phase::kNoImu;
    ++entry.after.not_finite;
    ++entry.after.reset.counter;
    outcome = {false, "state_not_finite", "The filter's state was not finite; it starts again."};
  }
  return outcome;
}

bool RewindBuffer::is_too_old(Nanoseconds stamp_ns) const {
  return !entries_.empty() &&
         stamp_ns < std::max(before_.stamp_ns, entries_.back().stamp_ns - length_ns_);
}

bool RewindBuffer::has_fix_at(Nanoseconds stamp_ns) const {
  return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
    return entry.stamp_ns == stamp_ns && std::holds_alternative<MapFix>(entry.measurement);
  });
}

void RewindBuffer::forget_old() {
  while (entries_.size() > 1 && entries_.front().stamp_ns < entries_.back().stamp_ns - length_ns_) {
    before_ = entries_.front().after;
    entries_.pop_front();
  }
}

void RewindBuffer::restart() {
  Track fresh = newest();
  fresh.phase = Phase::kNoImu;
  fresh.stamp_ns = fresh.imu_ns = fresh.accepted_ns = fresh.refused_ns = fresh.reset_ns = 0;
  fresh.refused = fresh.refused_height = RefusedStreak{};
  ++fresh.reset.counter;
  fresh.reset.delta = {};
  before_ = fresh;
  entries_.clear();
  newest_imu_ns_.reset();
}

void RewindBuffer::change_frame(const Eigen::Matrix3d& R_new_old,
                                const Eigen::Vector3d& t_new_old) {
  tracker_.change_frame(before_, R_new_old, t_new_old);
  for (Entry& entry : entries_) {
    tracker_.change_frame(entry.after, R_new_old, t_new_old);
    if (auto* fix = std::get_if<MapFix>(&entry.measurement)) {
      fix->antenna_map_m = R_new_old * fix->antenna_map_m + t_new_old;
      fix->covariance_map_m2 = R_new_old * fix->covariance_map_m2 * R_new_old.transpose();
    }
  }
}

void RewindBuffer::announce_reset(const YawPose& delta) {
  const auto announce = [&](Track& track) {
    ++track.reset.counter;
    track.reset.delta = delta;
    track.reset_ns = track.stamp_ns;
  };
  announce(before_);
  for (Entry& entry : entries_) {
    announce(entry.after);
  }
}

}  // namespace trigpoint::gps_odometry
