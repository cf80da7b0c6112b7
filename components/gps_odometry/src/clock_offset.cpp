// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clock_offset.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace trigpoint::gps_odometry {

namespace {

// Drift of the clocks that is followed, as a share of time.
constexpr double kLeak = 1e-3;
// Differences within this are one clock with an uneven latency; a step beyond is another clock.
constexpr double kStep_s = 0.5;
constexpr Nanoseconds kStep_ns = kNanosecondsPerSecond / 2;
// So many fixes over so long must agree on a new offset.
constexpr std::size_t kAgreeing = 3;
constexpr Nanoseconds kAgreeing_ns = kNanosecondsPerSecond;
constexpr Nanoseconds kLongestAgreement_ns = 10 * kNanosecondsPerSecond;
constexpr std::size_t kHeard = 32;
constexpr std::size_t kLeastStamps = 8;  // fewer do not tell the receiver's interval
// Of the usual interval, between a fix that comes late and those before and after it.
constexpr double kLeastGap = 0.8;
constexpr double kMostGap = 3.2;  // those may be late, too

std::string seconds(Nanoseconds duration_ns) {
  return std::to_string(to_seconds(duration_ns)) + " s";
}

/// From one difference of clocks to another. In seconds: differences of stamps from 0 to 8e9 s fit
/// into nanoseconds, their differences do not.
double moved_s(Nanoseconds from_ns, Nanoseconds to_ns) {
  return to_seconds(to_ns) - to_seconds(from_ns);
}

}  // namespace

ClockOffset::ClockOffset(const Config& config)
    : future_limit_ns_(from_seconds(config.future_limit_s)),
      same_ns_(from_seconds(config.clock_same_s)),
      latest_ns_(from_seconds(std::max(config.clock_latest_s, config.clock_same_s))),
      latency_ns_(from_seconds(config.clock_latency_s)),
      latency_sigma_s_(config.clock_latency_sigma_s) {}

bool ClockOffset::can_be_latency(Nanoseconds difference_ns) const {
  return difference_ns <= future_limit_ns_ && difference_ns >= -same_ns_;
}

bool ClockOffset::is_known(Nanoseconds difference_ns) const {
  return is_estimated_ ? std::abs(moved_s(soonest_ns_, difference_ns)) <= kStep_s
                       : can_be_latency(difference_ns);
}

/// A fix that is merely late has stamps that go on; only a clock goes back, or is off by more than
/// any link is slow.
bool ClockOffset::is_other_clock(Nanoseconds stamp_ns, Nanoseconds difference_ns) const {
  if (is_estimated_ || difference_ns > future_limit_ns_ || difference_ns < -latest_ns_) {
    return true;
  }
  const bool went_back = newest_stamp_ns_ && stamp_ns < *newest_stamp_ns_ - kStep_ns;
  return (went_back || !candidates_.empty()) && !fills_gap(stamp_ns);
}

/// A fix that was overtaken is missing among those that came. The stamps of a clock that went back
/// were there already, or lie anywhere between them.
bool ClockOffset::fills_gap(Nanoseconds stamp_ns) const {
  if (stamps_.size() < kLeastStamps) {
    return false;
  }
  std::vector<Nanoseconds> intervals_ns;
  for (auto it = std::next(stamps_.begin()); it != stamps_.end(); ++it) {
    intervals_ns.push_back(*it - *std::prev(it));
  }
  const auto middle = intervals_ns.begin() + static_cast<std::ptrdiff_t>(intervals_ns.size() / 2);
  std::nth_element(intervals_ns.begin(), middle, intervals_ns.end());
  const auto next = stamps_.lower_bound(stamp_ns);
  if (next == stamps_.begin() || next == stamps_.end()) {
    return false;
  }
  const auto is_neighbour = [&](Nanoseconds distance_ns) {
    const double share = to_seconds(distance_ns) / to_seconds(*middle);
    return share >= kLeastGap && share <= kMostGap;
  };
  return is_neighbour(*next - stamp_ns) && is_neighbour(stamp_ns - *std::prev(next));
}

void ClockOffset::remember(Nanoseconds stamp_ns) {
  stamps_.insert(stamp_ns);
  if (stamps_.size() > kHeard) {
    stamps_.erase(stamps_.begin());
  }
}

bool ClockOffset::heard_before(Nanoseconds stamp_ns) {
  if (std::find(heard_.begin(), heard_.end(), stamp_ns) != heard_.end()) {
    return true;
  }
  heard_.push_back(stamp_ns);
  if (heard_.size() > kHeard) {
    heard_.pop_front();
  }
  return false;
}

/// Only fixes in a row that agree with each other are kept; a silent IMU or a frozen clock makes
/// differences that run away.
void ClockOffset::keep(const Candidate& candidate) {
  const auto contradicts = [&](const Candidate& other) {
    return std::abs(moved_s(other.difference_ns, candidate.difference_ns)) > kStep_s ||
           candidate.imu_ns < other.imu_ns ||
           candidate.imu_ns - other.imu_ns > kLongestAgreement_ns;
  };
  if (std::any_of(candidates_.begin(), candidates_.end(), contradicts)) {
    candidates_.clear();
  }
  candidates_.push_back(candidate);
}

std::optional<Nanoseconds> ClockOffset::agreed() const {
  if (candidates_.size() < kAgreeing ||
      candidates_.back().imu_ns - candidates_.front().imu_ns < kAgreeing_ns) {
    return std::nullopt;
  }
  return std::max_element(candidates_.begin(),
                          candidates_.end(),
                          [](const Candidate& a, const Candidate& b) {
                            return a.difference_ns < b.difference_ns;
                          })
      ->difference_ns;
}

ClockVerdict ClockOffset::known(Nanoseconds stamp_ns, const Candidate& now) {
  candidates_.clear();
  newest_stamp_ns_ = std::max(newest_stamp_ns_.value_or(stamp_ns), stamp_ns);
  if (!is_estimated_) {
    remember(stamp_ns);
    return {stamp_ns, "", "", std::nullopt, false};
  }
  if (heard_before(stamp_ns)) {
    return {std::nullopt,
            "duplicate_stamp",
            "Fix refused: there was one with its stamp already.",
            std::nullopt,
            false};
  }
  const double elapsed_s = std::max(0.0, to_seconds(now.imu_ns - soonest_imu_ns_));
  soonest_ns_ = std::max(now.difference_ns, soonest_ns_ - from_seconds(kLeak * elapsed_s));
  soonest_imu_ns_ = now.imu_ns;
  return {stamp_ns - offset_ns(), "", "", std::nullopt, false};
}

ClockVerdict ClockOffset::other(Nanoseconds stamp_ns, const Candidate& now) {
  keep(now);
  if (const auto soonest_ns = agreed()) {
    is_estimated_ = !can_be_latency(*soonest_ns);
    soonest_ns_ = *soonest_ns;
    soonest_imu_ns_ = now.imu_ns;
    newest_stamp_ns_.reset();
    heard_.clear();
    stamps_.clear();
    ClockVerdict verdict = known(stamp_ns, now);
    verdict.event = Event{
        Severity::kWarning,
        now.imu_ns,
        "gnss_clock_known",
        is_estimated_
            ? "The fixes' clock is " + seconds(offset_ns()) + " ahead of the IMU's, by " +
                  std::to_string(kAgreeing) + " fixes or more over 1 s: their stamps are put right."
            : std::string("The fixes' clock is the IMU's: their stamps are used as they are.")};
    return verdict;
  }
  const double off_s = moved_s(is_estimated_ ? soonest_ns_ : 0, now.difference_ns);
  ClockVerdict verdict;
  verdict.is_ahead = off_s > 0.0;
  const bool is_behind = !is_estimated_ && now.difference_ns < -same_ns_;
  if (is_behind && now.difference_ns >= -latest_ns_) {
    verdict.reason = "clock_jump";  // the rewind buffer may reach there
    verdict.text = "Fix refused: its stamp is " + seconds(-now.difference_ns) +
                   " behind the IMU's and went back; a late one would go on.";
  } else if (is_estimated_) {
    verdict.reason = "clock_jump";
    verdict.text = "Fix refused: its clock is " + std::to_string(off_s) +
                   " s off what was estimated, expected at most " + seconds(kStep_ns) + ".";
  } else {
    verdict.stamp_ns = stamp_ns;  // refused for what it seems to be, future or past
  }
  if (candidates_.size() == 2) {
    verdict.event =
        Event{Severity::kWarning,
              now.imu_ns,
              "gnss_clock_moved",
              "The fixes' clock is " + std::to_string(off_s) +
                  " s off: fixes are not used until enough of them agree on its offset."};
  }
  return verdict;
}

ClockVerdict ClockOffset::place(Nanoseconds fix_stamp_ns, Nanoseconds imu_ns) {
  const Candidate now{fix_stamp_ns - imu_ns, imu_ns};
  if (is_known(now.difference_ns)) {
    return known(fix_stamp_ns, now);
  }
  if (is_other_clock(fix_stamp_ns, now.difference_ns)) {
    return other(fix_stamp_ns, now);
  }
  remember(fix_stamp_ns);
  return {fix_stamp_ns, "", "", std::nullopt, false};  // late
}

}  // namespace trigpoint::gps_odometry
