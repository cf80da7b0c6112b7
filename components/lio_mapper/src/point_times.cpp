// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "point_times.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace trigpoint::lio_mapper {
namespace {

constexpr std::array<std::pair<const char*, double>, 4> kUnits{
    {{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}}};

/// Relative times lie within a sweep of the stamp.
constexpr double kNearStamp_s = 1.0;
/// Times whose nearest to 0 is within this part of their span count from the stamp, even if the
/// stamp, soon after a simulation's start, is as near.
constexpr double kCountsFromZero = 0.2;
/// Two clocks are the same when they agree to this; transport and driver delays stay below.
constexpr double kSameClock_s = 10.0;
/// No clock reads more (the year 2096), so that nanoseconds fit 64 bits.
constexpr double kLatest_s = 4e9;

/// Distance of `value` from the range, 0 within.
double distance(double value, const TimeRange& range, double unit_s) {
  return std::max({0.0, range.lowest * unit_s - value, value - range.highest * unit_s});
}

TimeOrigin origin_of(const TimeRange& range, double unit_s, double stamp_s) {
  const double from_zero_s = distance(0.0, range, unit_s);
  const double from_stamp_s = distance(stamp_s, range, unit_s);
  const bool counts_from_zero = from_zero_s <= kCountsFromZero * range.span() * unit_s;
  if (counts_from_zero || (from_zero_s <= kNearStamp_s && from_zero_s <= from_stamp_s)) {
    return TimeOrigin::kStamp;
  }
  return from_stamp_s <= kSameClock_s ? TimeOrigin::kEpoch : TimeOrigin::kForeignClock;
}

/// The raw value (in seconds) at which the stamp was taken.
double anchor_s(const TimeMeaning& meaning, const TimeRange& range, const std::string& stamp_is) {
  const double first_s = range.lowest * meaning.unit_s;
  const double last_s = range.highest * meaning.unit_s;
  const bool relative = meaning.origin == TimeOrigin::kStamp;
  // Times after 0 count from the begin and times before 0 from the end, also when the very first or
  // last point of the sweep is not in the cloud.
  const double begin_s = relative && first_s >= 0.0 ? 0.0 : first_s;
  const double end_s = relative && last_s <= 0.0 ? 0.0 : last_s;
  if (stamp_is == "end") {
    return end_s;
  }
  if (stamp_is == "middle") {
    return 0.5 * (begin_s + end_s);
  }
  return stamp_is == "auto" && relative ? 0.0 : begin_s;
}

}  // namespace

std::optional<double> unit_of(const std::string& name) {
  for (const auto& [unit, seconds] : kUnits) {
    if (name == unit) {
      return seconds;
    }
  }
  return std::nullopt;
}

std::string name_of_unit(double unit_s) {
  for (const auto& [unit, seconds] : kUnits) {
    if (unit_s == seconds) {
      return unit;
    }
  }
  return std::to_string(unit_s) + " s";
}

bool is_plausible(const TimeRange& range, double unit_s) {
  const double span_s = range.span() * unit_s;
  return span_s > 0.0 && span_s <= kLongestSweep_s && std::abs(range.lowest) * unit_s < kLatest_s &&
         std::abs(range.highest) * unit_s < kLatest_s;
}

std::optional<TimeMeaning> detect_time_meaning(const TimeRange& range,
                                               Nanoseconds stamp_ns,
                                               std::optional<double> known_unit_s) {
  const double stamp_s = to_seconds(stamp_ns);
  std::optional<TimeMeaning> by_span;
  for (const auto& [name, unit_s] : kUnits) {
    if (!is_plausible(range, unit_s) || (known_unit_s && *known_unit_s != unit_s)) {
      continue;
    }
    const TimeMeaning meaning{unit_s, origin_of(range, unit_s, stamp_s)};
    const bool is_long_enough = range.span() * unit_s >= kShortestSweep_s;
    if (meaning.origin == TimeOrigin::kEpoch || known_unit_s) {
      return meaning;
    }
    if (is_long_enough && !by_span) {
      by_span = meaning;
    }
  }
  return by_span;
}

Nanoseconds time_of(double value,
                    const TimeMeaning& meaning,
                    const TimeRange& range,
                    Nanoseconds stamp_ns,
                    const std::string& stamp_is) {
  if (meaning.origin == TimeOrigin::kEpoch && stamp_is == "auto") {
    return from_seconds(value * meaning.unit_s);
  }
  return stamp_ns + from_seconds(value * meaning.unit_s - anchor_s(meaning, range, stamp_is));
}

}  // namespace trigpoint::lio_mapper
