// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "checks/accepted_fix.hpp"

#include <deque>
#include <map>
#include <optional>

namespace trigpoint::fusion_gate {

/// A fix that somebody has told of and that has no verdict yet.
struct ToldFix {
  AcceptedFix fix;
  std::optional<Refusal> refused_by_filter;  ///< as of now: a late fix may change it
  std::optional<Refusal> fault;              ///< found by the gate in what was told of it last

  std::optional<Refusal> refusal() const { return refused_by_filter ? refused_by_filter : fault; }
};

/// Puts fixes into the order of their stamps, so that what becomes of one depends on when it was
/// measured and not on when it came. A fix waits as long as an earlier one may still come: not at
/// all when the one before it, one interval of the receiver ago, is known; at most the window, and
/// less where all fixes come sooner than that, so that the first one after an outage, which has no
/// predecessor, is not held back for a lateness that this receiver does not have.
class FixQueue {
 public:
  explicit FixQueue(double window_s) : window_s_(window_s) {}

  /// A message on gps/fix, whatever becomes of it. It counts as told of after a while: a filter
  /// that refuses the message itself does not tell of it. `now_ns` is data time, 0 before there is
  /// any; stamps far ahead of it are not heard.
  void hear(Nanoseconds stamp_ns, Nanoseconds now_ns);

  /// A stamp beyond every clock's error: nothing with it may wait, it would wait for ever.
  static bool is_far_ahead(Nanoseconds stamp_ns, Nanoseconds now_ns);

  /// Adds a fix, or changes what is held of one that waits.
  void put(const ToldFix& told);

  /// The one that waits with this stamp.
  const ToldFix* find(Nanoseconds stamp_ns) const;

  /// The oldest, once no earlier one is to be waited for.
  const ToldFix* next(Nanoseconds now_ns) const;

  /// Takes the oldest out: it gets its verdict.
  ToldFix take();

  /// Whether a later fix has its verdict already.
  bool is_overtaken(Nanoseconds stamp_ns) const { return stamp_ns < newest_judged_ns_; }

  const std::deque<ToldFix>& waiting() const { return waiting_; }

  void clear_waiting() { waiting_.clear(); }

 private:
  double wait_s() const;
  bool is_predecessor_known(Nanoseconds stamp_ns, Nanoseconds now_ns) const;
  std::optional<Nanoseconds> usual_interval_ns() const;
  bool know(Nanoseconds stamp_ns, Nanoseconds from_ns);

  double window_s_;
  std::deque<ToldFix> waiting_;               // by stamp
  std::map<Nanoseconds, Nanoseconds> known_;  // stamps, and since when they count as told of
  std::deque<double> lateness_s_;             // of the messages that were heard last
  Nanoseconds newest_judged_ns_{0};
};

}  // namespace trigpoint::fusion_gate
