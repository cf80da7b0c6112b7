// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include <algorithm>
#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <string>

namespace trigpoint::bus {

/// The four moments of a question and its answer; the middle two by the other computer's clock.
struct ClockExchange {
  Nanoseconds asked_ns{0};
  Nanoseconds heard_there_ns{0};
  Nanoseconds answered_there_ns{0};
  Nanoseconds heard_ns{0};
};

struct ClockOffset {
  Nanoseconds offset_ns{0};      ///< the other clock minus ours
  Nanoseconds round_trip_ns{0};  ///< without the time that the other took; half is the uncertainty
};

/// As NTP does (RFC 5905, section 8): half the difference of the two ways, which is right when they
/// take equally long, and wrong by at most half the round trip.
inline ClockOffset offset_of(const ClockExchange& e) {
  return {((e.heard_there_ns - e.asked_ns) + (e.answered_there_ns - e.heard_ns)) / 2,
          (e.heard_ns - e.asked_ns) - (e.answered_there_ns - e.heard_there_ns)};
}

/// The clocks of other computers, by name. Of the newest exchanges the one with the shortest round
/// trip counts: what waited in a queue waited on one way only (RFC 5905, section 10).
class ClockOffsets {
 public:
  static constexpr std::size_t kRemembered = 16;

  void add(const std::string& computer, const ClockExchange& exchange) {
    const ClockOffset offset = offset_of(exchange);
    if (offset.round_trip_ns < 0) {
      return;  // a clock was set in between
    }
    auto& newest = newest_[computer];
    newest.push_back(offset);
    if (newest.size() > kRemembered) {
      newest.pop_front();
    }
  }

  std::optional<ClockOffset> best(const std::string& computer) const {
    const auto found = newest_.find(computer);
    if (found == newest_.end()) {
      return std::nullopt;
    }
    return *std::min_element(
        found->second.begin(), found->second.end(), [](const ClockOffset& a, const ClockOffset& b) {
          return a.round_trip_ns < b.round_trip_ns;
        });
  }

 private:
  std::map<std::string, std::deque<ClockOffset>> newest_;
};

}  // namespace trigpoint::bus
