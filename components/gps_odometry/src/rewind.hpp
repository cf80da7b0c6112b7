// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Late measurements at their own stamps: the last second of measurements with the Track after each.
// A late one is put in its place and everything after it is done again, so that the result is that
// of sorted input. Any filter's tracker fits that has a plain `State` derived from Track.
#pragma once

#include "imu_checks.hpp"
#include "track.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <iterator>
#include <optional>
#include <variant>
#include <vector>

namespace trigpoint::gps_odometry {

template <typename TrackerType>
class RewindBuffer {
 public:
  using State = typename TrackerType::State;

  RewindBuffer(const TrackerType& tracker, Nanoseconds length_ns);

  /// IMU samples come in order among themselves, but may be older than a fix.
  void insert(const CheckedImu& imu);

  /// The outcome at the fix's own epoch. The fix must be neither too old nor a duplicate.
  FixOutcome insert(const MapFix& fix);

  /// Neither may be too old.
  FixOutcome insert(const CheckedTwist& twist);
  FixOutcome insert(const Heading& yaw);

  bool is_too_old(Nanoseconds stamp_ns) const;
  bool has_fix_at(Nanoseconds stamp_ns) const;

  /// What is held of every fix in the buffer: that of sorted input once all have come.
  std::vector<FixRecord> fixes() const;

  /// The newest state.
  const State& newest() const { return entries_.empty() ? before_ : entries_.back().after; }

  std::optional<Nanoseconds> newest_imu_ns() const { return newest_imu_ns_; }

  /// Forgets all measurements; counters and resets live on. Announces a reset.
  void restart();

  void change_frame(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t_new_old);

  /// Changes the newest state and forgets the measurements before it.
  template <typename Change>
  void replace_newest(const Change& change);

  /// Announces a reset of all states alike.
  void announce_reset(const YawPose& delta);

 private:
  using Measurement =
      std::variant<CheckedImu, MapFix, CheckedTwist, Heading>;  // in the order of equal stamps

  struct Entry {
    Nanoseconds stamp_ns{0};
    Measurement measurement;
    State after;
    FixOutcome outcome;  ///< of a fix
  };

  FixOutcome insert(Nanoseconds stamp_ns, const Measurement& measurement);
  FixOutcome apply(Entry& entry, const State& before);
  void watch(Entry& entry, const State& before);
  void forget_old();

  const TrackerType& tracker_;
  Nanoseconds length_ns_;
  State before_;  ///< the state before the oldest entry
  std::deque<Entry> entries_;
  std::optional<Nanoseconds> newest_imu_ns_;
  std::optional<State> sound_;  ///< the newest state whose covariance was found positive
};

template <typename TrackerType>
RewindBuffer<TrackerType>::RewindBuffer(const TrackerType& tracker, Nanoseconds length_ns)
    : tracker_(tracker), length_ns_(length_ns) {}

template <typename TrackerType>
void RewindBuffer<TrackerType>::insert(const CheckedImu& imu) {
  newest_imu_ns_ = imu.stamp_ns;
  insert(imu.stamp_ns, imu);
  forget_old();
}

template <typename TrackerType>
FixOutcome RewindBuffer<TrackerType>::insert(const MapFix& fix) {
  const FixOutcome outcome = insert(fix.checked.stamp_ns, fix);
  forget_old();
  return outcome;
}

template <typename TrackerType>
FixOutcome RewindBuffer<TrackerType>::insert(const CheckedTwist& twist) {
  const FixOutcome outcome = insert(twist.stamp_ns, twist);
  forget_old();
  return outcome;
}

template <typename TrackerType>
FixOutcome RewindBuffer<TrackerType>::insert(const Heading& yaw) {
  const FixOutcome outcome = insert(yaw.stamp_ns, yaw);
  forget_old();
  return outcome;
}

template <typename TrackerType>
FixOutcome RewindBuffer<TrackerType>::insert(Nanoseconds stamp_ns, const Measurement& measurement) {
  const auto is_before = [&](const Entry& entry) {
    return entry.stamp_ns < stamp_ns ||
           (entry.stamp_ns == stamp_ns && entry.measurement.index() <= measurement.index());
  };
  // From the end: nearly everything comes in order.
  auto place = entries_.end();
  while (place != entries_.begin() && !is_before(*std::prev(place))) {
    --place;
  }
  place = entries_.insert(place, Entry{stamp_ns, measurement, State{}, {}});
  const auto before = [&](auto it) -> const State& {
    return it == entries_.begin() ? before_ : std::prev(it)->after;
  };
  const FixOutcome outcome = apply(*place, before(place));
  for (auto it = std::next(place); it != entries_.end(); ++it) {
    apply(*it, before(it));
  }
  return outcome;
}

template <typename TrackerType>
FixOutcome RewindBuffer<TrackerType>::apply(Entry& entry, const State& before) {
  entry.after = before;
  FixOutcome outcome;
  if (const auto* imu = std::get_if<CheckedImu>(&entry.measurement)) {
    tracker_.apply(entry.after, *imu);
  } else if (const auto* fix = std::get_if<MapFix>(&entry.measurement)) {
    outcome = tracker_.apply(entry.after, *fix);
  } else if (const auto* twist = std::get_if<CheckedTwist>(&entry.measurement)) {
    outcome = tracker_.apply(entry.after, *twist);
  } else {
    outcome = tracker_.apply(entry.after, std::get<Heading>(entry.measurement));
  }
  if (!entry.after.filter.is_finite()) {
    // Cannot be, and must not spread if it is: start again from the next sample.
    entry.after = before;
    entry.after.phase = Phase::kNoImu;
    ++entry.after.not_finite;
    ++entry.after.reset.counter;
    outcome = {false, "state_not_finite", "The filter's state was not finite; it starts again."};
  } else {
    watch(entry, before);
  }
  entry.outcome = outcome;
  return outcome;
}

/// Once a second of data time: bounds the covariance, and goes back to the last state whose
/// covariance was positive when it is not. The prediction from there bridges the gap and says so in
/// its covariance.
template <typename TrackerType>
void RewindBuffer<TrackerType>::watch(Entry& entry, const State& before) {
  const auto* imu = std::get_if<CheckedImu>(&entry.measurement);
  if (imu == nullptr || entry.after.phase == Phase::kNoImu ||
      entry.stamp_ns / kNanosecondsPerSecond == before.stamp_ns / kNanosecondsPerSecond) {
    return;
  }
  entry.after.filter.bound();
  if (entry.after.filter.is_positive()) {
    sound_ = entry.after;
    return;
  }
  const Track kept = before;
  entry.after = before;
  if (sound_ && sound_->stamp_ns <= entry.stamp_ns) {
    entry.after = *sound_;
    static_cast<Track&>(entry.after) = kept;
    entry.after.stamp_ns = sound_->stamp_ns;
    entry.after.imu_ns = sound_->imu_ns;
    entry.after.phase = sound_->phase;
    tracker_.apply(entry.after, *imu);
  }
  if (!entry.after.filter.is_finite() || !entry.after.filter.is_positive()) {
    entry.after.phase = Phase::kNoImu;
  }
  ++entry.after.restored;
  ++entry.after.reset.counter;
  entry.after.reset.delta = {};
  entry.after.reset_ns = entry.stamp_ns;
}

template <typename TrackerType>
bool RewindBuffer<TrackerType>::is_too_old(Nanoseconds stamp_ns) const {
  return !entries_.empty() &&
         stamp_ns < std::max(before_.stamp_ns, entries_.back().stamp_ns - length_ns_);
}

template <typename TrackerType>
bool RewindBuffer<TrackerType>::has_fix_at(Nanoseconds stamp_ns) const {
  return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
    return entry.stamp_ns == stamp_ns && std::holds_alternative<MapFix>(entry.measurement);
  });
}

template <typename TrackerType>
std::vector<FixRecord> RewindBuffer<TrackerType>::fixes() const {
  std::vector<FixRecord> records;
  for (const Entry& entry : entries_) {
    if (std::holds_alternative<MapFix>(entry.measurement)) {
      records.push_back(record_of(entry.stamp_ns, entry.outcome, entry.after));
    }
  }
  return records;
}

template <typename TrackerType>
void RewindBuffer<TrackerType>::forget_old() {
  while (entries_.size() > 1 && entries_.front().stamp_ns < entries_.back().stamp_ns - length_ns_) {
    before_ = entries_.front().after;
    entries_.pop_front();
  }
}

template <typename TrackerType>
void RewindBuffer<TrackerType>::restart() {
  State fresh = newest();
  fresh.phase = Phase::kNoImu;
  fresh.stamp_ns = fresh.imu_ns = fresh.accepted_ns = fresh.refused_ns = fresh.reset_ns = 0;
  fresh.refused = fresh.refused_height = RefusedStreak{};
  fresh.aiding = AidingState{};
  ++fresh.reset.counter;
  fresh.reset.delta = {};
  before_ = fresh;
  entries_.clear();
  newest_imu_ns_.reset();
  sound_.reset();
}

template <typename TrackerType>
void RewindBuffer<TrackerType>::change_frame(const Eigen::Matrix3d& R_new_old,
                                             const Eigen::Vector3d& t_new_old) {
  const double turn_rad = std::atan2(R_new_old(1, 0), R_new_old(0, 0));
  tracker_.change_frame(before_, R_new_old, t_new_old);
  if (sound_) {
    tracker_.change_frame(*sound_, R_new_old, t_new_old);
  }
  for (Entry& entry : entries_) {
    tracker_.change_frame(entry.after, R_new_old, t_new_old);
    if (auto* fix = std::get_if<MapFix>(&entry.measurement)) {
      fix->antenna_map_m = R_new_old * fix->antenna_map_m + t_new_old;
      fix->covariance_map_m2 = R_new_old * fix->covariance_map_m2 * R_new_old.transpose();
    } else if (auto* yaw = std::get_if<Heading>(&entry.measurement)) {
      yaw->yaw_map_rad += turn_rad;
    }
  }
}

template <typename TrackerType>
template <typename Change>
void RewindBuffer<TrackerType>::replace_newest(const Change& change) {
  if (entries_.empty()) {
    return;
  }
  change(entries_.back().after);
  before_ = entries_.back().after;
  entries_.erase(entries_.begin(), std::prev(entries_.end()));
}

template <typename TrackerType>
void RewindBuffer<TrackerType>::announce_reset(const YawPose& delta) {
  const auto announce = [&](State& track) {
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
