// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include <map>
#include <optional>
#include <string>

namespace trigpoint::fusion_gate {

/// What is known of one GPS writer.
struct GpsSource {
  Nanoseconds first_heard_ns{0};
  Nanoseconds last_heard_ns{0};
  double usual_gap_s{0.0};  ///< longest between two of its stamps, forgotten within seconds
  std::optional<Odometry> odometry;  ///< newest
  std::optional<GpsStatus> status;   ///< newest
};

/// The GPS writers on the bus, and which of them is followed: the healthiest, then one whose sigma
/// keeps the thresholds, then the one with the newest accepted fix. The followed one is kept until
/// it goes stale, falls silent for longer than it usually does while another one speaks, or another
/// one has for source_hold_s been healthier, kept the thresholds that it does not keep, or been
/// ahead by source_timeout_s of accepted fixes.
class GpsSources {
 public:
  explicit GpsSources(const Config& config);

  /// A fault when the odometry cannot be used (stamp, frame, not finite): it is then not kept.
  std::optional<std::string> on_odometry(const Odometry& odometry, const std::string& writer);
  void on_status(const GpsStatus& status, const std::string& writer);

  /// True when the followed writer changed.
  bool select(Nanoseconds now_ns);

  const std::string& followed() const { return followed_; }  ///< empty: none

  const GpsSource* followed_source() const;
  const GpsSource* find(const std::string& writer) const;
  bool is_foreign(const std::string& writer, Nanoseconds now_ns) const;

 private:
  GpsSource& heard(const std::string& writer, Nanoseconds stamp_ns);
  bool is_stale(const GpsSource& source, Nanoseconds now_ns) const;
  bool is_silent(const GpsSource& source, Nanoseconds now_ns) const;
  bool may_stand_in(const GpsSource& candidate, const GpsSource& current, Nanoseconds now_ns) const;
  void forget_dead(Nanoseconds now_ns);
  /// Lower is better: 0 ok, 1 degraded, 2 foreign (says nothing of itself), 3 init, 4 dead
  /// reckoning, 5 stale, 6 fault.
  int rank_of(const GpsSource& source) const;
  /// On any axis, by its newest odometry, where it tells of itself; NaN is above.
  bool is_above_threshold(const GpsSource& source) const;
  bool is_better(const GpsSource& candidate, const GpsSource& current) const;
  std::string best_alive(Nanoseconds now_ns) const;

  Config config_;
  Eigen::Vector3d threshold_m_;
  std::map<std::string, GpsSource> sources_;
  std::string followed_;
  std::string challenger_;
  Nanoseconds challenger_since_ns_{0};
};

}  // namespace trigpoint::fusion_gate
