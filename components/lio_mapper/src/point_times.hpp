// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the numbers in a cloud's time field mean: the least agreed-upon part of a PointCloud2.
#pragma once

#include "trigpoint/base/time.hpp"

#include <limits>
#include <optional>
#include <string>

namespace trigpoint::lio_mapper {

/// A sweep takes this long. Less than a factor 1000 apart, so that the span of the times tells
/// their unit; covers 1 to 100 Hz and parts of sweeps down to 1 ms.
inline constexpr double kShortestSweep_s = 1e-3;
inline constexpr double kLongestSweep_s = 1.0;

/// Smallest and largest raw value of a time field.
struct TimeRange {
  double lowest{std::numeric_limits<double>::infinity()};
  double highest{-std::numeric_limits<double>::infinity()};

  void add(double value) {
    lowest = value < lowest ? value : lowest;
    highest = value > highest ? value : highest;
  }

  double span() const { return highest - lowest; }
};

enum class TimeOrigin {
  kStamp,        ///< seconds after the cloud's stamp (negative before it)
  kEpoch,        ///< absolute, on the stamp's clock
  kForeignClock  ///< absolute on a clock that is not the stamp's, or counted from somewhere else
};

struct TimeMeaning {
  double unit_s{1.0};
  TimeOrigin origin{TimeOrigin::kStamp};
};

/// 1, 1e-3, 1e-6, 1e-9 for s, ms, us, ns; nothing for another word.
std::optional<double> unit_of(const std::string& name);
std::string name_of_unit(double unit_s);

/// True when `range` in this unit is a sweep's length and its origin is not in doubt.
bool is_plausible(const TimeRange& range, double unit_s);

/// Unit from the values' distance to the stamp when they are absolute, else from their span;
/// nothing when no unit makes the values a sweep. `known_unit_s` restricts the choice.
std::optional<TimeMeaning> detect_time_meaning(const TimeRange& range,
                                               Nanoseconds stamp_ns,
                                               std::optional<double> known_unit_s);

/// Time of the raw value `value`, for values that passed is_plausible.
/// `stamp_is` is auto, begin, middle or end. Auto believes the values: relative ones count from the
/// stamp, absolute ones are the time; of a foreign clock the stamp is taken for the begin.
/// `range` must hold all points with a relative time, also those out of range, which still tell
/// when the sweep began.
Nanoseconds time_of(double value,
                    const TimeMeaning& meaning,
                    const TimeRange& range,
                    Nanoseconds stamp_ns,
                    const std::string& stamp_is);

}  // namespace trigpoint::lio_mapper
