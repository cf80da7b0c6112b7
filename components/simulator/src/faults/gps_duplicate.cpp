// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_duplicate.hpp"

namespace trigpoint::simulator {

void GpsDuplicate::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the fixes that are repeated", {0.0, 1.0});
  fields.integer("copies", copies_, "besides the first", {1.0, 100.0});
  fields.number("apart_s", apart_s_, "between their arrivals", kNotNegative);
}

void GpsDuplicate::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (moment.each.chance(share_)) {
    epoch.copies += static_cast<int>(copies_);
    epoch.copies_apart_s = apart_s_;
  }
}

}  // namespace trigpoint::simulator
