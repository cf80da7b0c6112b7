// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Late measurements at their own stamps: the last second of measurements with the Track after each.
// A late one is put in its place and everything after it is done again, so that the result is that
// of sorted input.
#pragma once

#include "track.hpp"

#include <deque>
#include <optional>
#include <variant>

namespace trigpoint::gps_odometry {

class RewindBuffer {
 public:
  RewindBuffer(const Tracker& tracker, Nanoseconds length_ns);

  /// IMU samples come in order among themselves, but may be older than a fix.
  void insert(const CheckedImu& imu);

  /// The outcome at the fix's own epoch. The fix must be neither too old nor a duplicate.
  FixOutcome insert(const MapFix& fix);

  bool is_too_old(Nanoseconds stamp_ns) const;
  bool has_fix_at(Nanoseconds stamp_ns) const;

  /// The newest state.
  const Track& newest() const { return entries_.empty() ? before_ : entries_.back().after; }

  std::optional<Nanoseconds> newest_imu_ns() const { return newest_imu_ns_; }

  /// Forgets all measurements; counters and resets live on. Announces a reset.
  void restart();

  void change_frame(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t_new_old);

  /// Announces a reset of all states alike.
  void announce_reset(const YawPose& delta);

 private:
  using Measurement = std::variant<CheckedImu, MapFix>;  // in the order of equal stamps

  struct Entry {
    Nanoseconds stamp_ns{0};
    Measurement measurement;
    Track after;
  };

  FixOutcome insert(Nanoseconds stamp_ns, const Measurement& measurement);
  FixOutcome apply(Entry& entry, const Track& before) const;
  void forget_old();

  const Tracker& tracker_;
  Nanoseconds length_ns_;
  Track before_;  ///< the state before the oldest entry
  std::deque<Entry> entries_;
  std::optional<Nanoseconds> newest_imu_ns_;
};

}  // namespace trigpoint::gps_odometry
