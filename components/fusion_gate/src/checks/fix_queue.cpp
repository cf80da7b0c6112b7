// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/fix_queue.hpp"

#include <algorithm>
#include <vector>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::size_t kKnown = 64;        // as long as any window, of a receiver at 20 Hz
constexpr std::size_t kLeastKnown = 8;    // fewer do not tell the receiver's interval
constexpr double kLongestInterval = 1.6;  // of the usual one: stamps jitter, a lost fix makes two
/// A fix may be as much later than the latest of those before it.
constexpr double kLaterThanUsual_s = 1.0;
constexpr Nanoseconds kUntilTold_ns = 100'000'000;
constexpr Nanoseconds kFarthestAhead_ns = kNanosecondsPerSecond;  // a stamp beyond has a wrong date

bool is_earlier(const ToldFix& a, const ToldFix& b) {
  return a.fix.stamp_ns < b.fix.stamp_ns;
}

}  // namespace

void FixQueue::hear(Nanoseconds stamp_ns, Nanoseconds now_ns) {
  if (now_ns > 0) {
    const Nanoseconds latest_ns = now_ns + kFarthestAhead_ns;
    known_.erase(known_.upper_bound(latest_ns), known_.end());  // they would displace true ones
    if (stamp_ns > latest_ns) {
      return;
    }
  }
  const bool is_new = know(stamp_ns, now_ns + kUntilTold_ns);
  if (is_new && now_ns > 0) {
    lateness_s_.push_back(to_seconds(now_ns - stamp_ns));
    if (lateness_s_.size() > kKnown) {
      lateness_s_.pop_front();
    }
  }
}

bool FixQueue::is_far_ahead(Nanoseconds stamp_ns, Nanoseconds now_ns) {
  return now_ns > 0 && stamp_ns > now_ns + kFarthestAhead_ns;
}

void FixQueue::put(const ToldFix& told) {
  know(told.fix.stamp_ns, 0);
  const auto place = std::lower_bound(waiting_.begin(), waiting_.end(), told, is_earlier);
  if (place != waiting_.end() && place->fix.stamp_ns == told.fix.stamp_ns) {
    *place = told;
  } else {
    waiting_.insert(place, told);
  }
}

const ToldFix* FixQueue::find(Nanoseconds stamp_ns) const {
  const auto found = std::find_if(waiting_.begin(), waiting_.end(), [&](const ToldFix& told) {
    return told.fix.stamp_ns == stamp_ns;
  });
  return found == waiting_.end() ? nullptr : &*found;
}

const ToldFix* FixQueue::next(Nanoseconds now_ns) const {
  if (waiting_.empty()) {
    return nullptr;
  }
  const ToldFix& oldest = waiting_.front();
  const bool waited_enough = to_seconds(now_ns - oldest.fix.stamp_ns) >= wait_s();
  return waited_enough || is_predecessor_known(oldest.fix.stamp_ns, now_ns) ? &oldest : nullptr;
}

ToldFix FixQueue::take() {
  const ToldFix oldest = waiting_.front();
  waiting_.pop_front();
  newest_judged_ns_ = std::max(newest_judged_ns_, oldest.fix.stamp_ns);
  return oldest;
}

/// From a fix's stamp, until the ones before it are held to be lost.
double FixQueue::wait_s() const {
  if (lateness_s_.size() < kLeastKnown) {
    return window_s_;
  }
  const double latest_s = *std::max_element(lateness_s_.begin(), lateness_s_.end());
  return std::min(window_s_, std::max(0.0, latest_s) + kLaterThanUsual_s);
}

/// From fix to fix back to one that has its verdict, or for which nobody waits any more.
bool FixQueue::is_predecessor_known(Nanoseconds stamp_ns, Nanoseconds now_ns) const {
  const auto interval_ns = usual_interval_ns();
  if (!interval_ns) {
    return false;
  }
  Nanoseconds at_ns = stamp_ns;
  for (auto it = known_.lower_bound(stamp_ns); it != known_.begin();) {
    --it;
    if (it->second > now_ns) {
      return false;  // heard, and the filter is about to tell of it
    }
    if (to_seconds(at_ns - it->first) > kLongestInterval * to_seconds(*interval_ns)) {
      return false;
    }
    at_ns = it->first;
    if (at_ns <= newest_judged_ns_ || to_seconds(now_ns - at_ns) >= wait_s()) {
      return true;
    }
  }
  return false;
}

/// The lower quartile of the intervals: some are longer because a fix between is missing.
std::optional<Nanoseconds> FixQueue::usual_interval_ns() const {
  if (known_.size() < kLeastKnown) {
    return std::nullopt;
  }
  std::vector<Nanoseconds> intervals_ns;
  for (auto it = std::next(known_.begin()); it != known_.end(); ++it) {
    intervals_ns.push_back(it->first - std::prev(it)->first);
  }
  const auto quartile = intervals_ns.begin() + static_cast<std::ptrdiff_t>(intervals_ns.size() / 4);
  std::nth_element(intervals_ns.begin(), quartile, intervals_ns.end());
  return *quartile;
}

/// True when nobody had told of the stamp.
bool FixQueue::know(Nanoseconds stamp_ns, Nanoseconds from_ns) {
  const auto [entry, is_new] = known_.try_emplace(stamp_ns, from_ns);
  entry->second = std::min(entry->second, from_ns);
  if (known_.size() > kKnown) {
    known_.erase(known_.begin());
  }
  return is_new;
}

}  // namespace trigpoint::fusion_gate
