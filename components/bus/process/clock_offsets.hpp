// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
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

/// What an exchange is not used for, or nothing. Moments come from the network: beyond these bounds
/// their differences need more than 64 bits.
inline std::optional<std::string> find_fault(const ClockExchange& e) {
  constexpr Nanoseconds kYear_ns = 31'557'600 * kNanosecondsPerSecond;
  constexpr Nanoseconds kLatest_ns = 130 * kYear_ns;   // since 1970
  constexpr Nanoseconds kFarthest_ns = 70 * kYear_ns;  // a computer without a clock begins in 1970
  for (const Nanoseconds stamp_ns :
       {e.heard_ns, e.asked_ns, e.heard_there_ns, e.answered_there_ns}) {
    if (stamp_ns < -kLatest_ns || stamp_ns > kLatest_ns ||
        std::abs(stamp_ns - e.heard_ns) > kFarthest_ns) {
      return "a time of " + std::to_string(stamp_ns) +
             " ns where one within 70 years of ours is expected";
    }
  }
  return std::nullopt;
}

/// What is wrong with the name of a computer, or nothing: it goes into files and on terminals.
inline std::optional<std::string> find_name_fault(const std::string& name) {
  constexpr std::size_t kLongest = 64;
  const bool is_safe = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '-' || c == '_';
  });
  if (!name.empty() && name.size() <= kLongest && is_safe) {
    return std::nullopt;
  }
  return "a name of " + std::to_string(name.size()) +
         " bytes where 1 to 64 of A-Z a-z 0-9 . - _ are expected" +
         (is_safe ? "" : ", and there are others in it");
}

/// Of an exchange in which find_fault finds none. As NTP does (RFC 5905, section 8): half the
/// difference of the two ways, which is right when they take equally long, and wrong by at most
/// half the round trip.
inline ClockOffset offset_of(const ClockExchange& e) {
  return {((e.heard_there_ns - e.asked_ns) + (e.answered_there_ns - e.heard_ns)) / 2,
          (e.heard_ns - e.asked_ns) - (e.answered_there_ns - e.heard_there_ns)};
}

/// The clocks of other computers, by name. Of the newest exchanges the one with the shortest round
/// trip counts: what waited in a queue waited on one way only (RFC 5905, section 10).
class ClockOffsets {
 public:
  static constexpr std::size_t kRemembered = 16;
  static constexpr std::size_t kMostComputers = 64;
  /// Without an answer for so long, a computer leaves its place to another one.
  static constexpr Nanoseconds kForgotten_ns = 60 * kNanosecondsPerSecond;

  /// Why the exchange is refused, or nothing.
  std::optional<std::string> add(const std::string& computer, const ClockExchange& exchange) {
    if (const auto fault = find_name_fault(computer)) {
      return fault;
    }
    if (const auto fault = find_fault(exchange)) {
      return fault;
    }
    const ClockOffset offset = offset_of(exchange);
    if (offset.round_trip_ns < 0) {
      return std::nullopt;  // a clock was set in between
    }
    if (newest_.size() >= kMostComputers && !newest_.contains(computer)) {
      std::erase_if(newest_, [&](const auto& entry) {
        return std::abs(exchange.heard_ns - entry.second.heard_ns) > kForgotten_ns;
      });
      if (newest_.size() >= kMostComputers) {
        return "there are " + std::to_string(kMostComputers) + " other computers already";
      }
    }
    Newest& newest = newest_[computer];
    newest.heard_ns = exchange.heard_ns;
    newest.offsets.push_back(offset);
    if (newest.offsets.size() > kRemembered) {
      newest.offsets.pop_front();
    }
    return std::nullopt;
  }

  std::optional<ClockOffset> best(const std::string& computer) const {
    const auto found = newest_.find(computer);
    if (found == newest_.end()) {
      return std::nullopt;
    }
    const auto& offsets = found->second.offsets;
    return *std::min_element(
        offsets.begin(), offsets.end(), [](const ClockOffset& a, const ClockOffset& b) {
          return a.round_trip_ns < b.round_trip_ns;
        });
  }

  std::size_t size() const { return newest_.size(); }

 private:
  struct Newest {
    Nanoseconds heard_ns{0};
    std::deque<ClockOffset> offsets;
  };

  std::map<std::string, Newest> newest_;
};

}  // namespace trigpoint::bus
