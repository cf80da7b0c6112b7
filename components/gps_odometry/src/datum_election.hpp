// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include "fix_checks.hpp"

#include <optional>
#include <vector>

namespace trigpoint::gps_odometry {

/// The datum that the configuration names, if any; throws ConfigError when that is not a place.
std::optional<Datum> configured_datum(const Config& config);

/// True when `candidate` replaces `present`: the older election wins; of two elections of one
/// moment the one with the smaller id, so that everybody decides alike.
bool wins(const Datum& candidate, const Datum& present);

/// Mean of the first good fixes, once nobody else named a datum for a while.
class DatumElection {
 public:
  explicit DatumElection(const Config& config);

  /// Data time began; the wait counts from here.
  void begin(Nanoseconds stamp_ns);

  /// Takes a checked fix; the datum when it completes the election.
  std::optional<Datum> add(const CheckedFix& fix);

 private:
  Nanoseconds wait_ns_;
  std::size_t fixes_;
  double highest_speed_mps_;
  std::optional<Nanoseconds> began_ns_;
  std::vector<CheckedFix> candidates_;
};

}  // namespace trigpoint::gps_odometry
