// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The clock of the fixes against the IMU's, where they differ (UTC, GPS time, another computer).
// There is no clock in here: the newest IMU stamp is the time at which a fix arrives.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <deque>
#include <optional>
#include <set>
#include <string>

namespace trigpoint::gps_odometry {

struct ClockVerdict {
  std::optional<Nanoseconds> stamp_ns;  ///< on the IMU's clock; nullopt: refused
  std::string reason;                   ///< of a refusal
  std::string text;
  std::optional<Event> event;  ///< a clock has moved, or is known again
  bool is_ahead{false};        ///< of the IMU: it may have fallen silent
};

/// Difference d = stamp - newest IMU stamp at arrival = offset - latency. While d can be a latency
/// the clocks are one and stamps stay as they are. Otherwise the offset is the largest d, which
/// arrived soonest (leaky, so that it follows the drift of the clocks), plus the least latency.
class ClockOffset {
 public:
  explicit ClockOffset(const Config& config);

  ClockVerdict place(Nanoseconds fix_stamp_ns, Nanoseconds imu_ns);

  /// What is not known of a stamp (s); 0 while the clocks are one.
  double stamp_sigma_s() const { return is_estimated_ ? latency_sigma_s_ : 0.0; }

  bool is_estimated() const { return is_estimated_; }

  /// Add to the IMU's clock; 0 while the clocks are one.
  Nanoseconds offset_ns() const { return is_estimated_ ? soonest_ns_ + latency_ns_ : 0; }

 private:
  struct Candidate {
    Nanoseconds difference_ns;
    Nanoseconds imu_ns;
  };

  bool can_be_latency(Nanoseconds difference_ns) const;
  bool is_known(Nanoseconds difference_ns) const;
  bool is_other_clock(Nanoseconds stamp_ns, Nanoseconds difference_ns) const;
  bool fills_gap(Nanoseconds stamp_ns) const;
  void remember(Nanoseconds stamp_ns);
  bool heard_before(Nanoseconds stamp_ns);
  void keep(const Candidate& candidate);
  std::optional<Nanoseconds> agreed() const;
  ClockVerdict known(Nanoseconds stamp_ns, const Candidate& now);
  ClockVerdict other(Nanoseconds stamp_ns, const Candidate& now);

  Nanoseconds future_limit_ns_;
  Nanoseconds same_ns_;
  Nanoseconds latest_ns_;
  Nanoseconds latency_ns_;
  double latency_sigma_s_;

  bool is_estimated_{false};
  Nanoseconds soonest_ns_{0};  ///< leaky maximum of the difference
  Nanoseconds soonest_imu_ns_{0};
  std::optional<Nanoseconds> newest_stamp_ns_;  ///< of fixes on the known clock
  std::deque<Candidate> candidates_;            ///< fixes in a row that are on another clock
  std::set<Nanoseconds> stamps_;                ///< the newest, of fixes on the IMU's clock
  std::deque<Nanoseconds> heard_;               ///< stamps as they came
};

}  // namespace trigpoint::gps_odometry
