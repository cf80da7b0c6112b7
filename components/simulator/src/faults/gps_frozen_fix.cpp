// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_frozen_fix.hpp"

namespace trigpoint::simulator {

void GpsFrozenFix::describe(ConfigFields&) {}

void GpsFrozenFix::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  epoch.frozen = true;
}

}  // namespace trigpoint::simulator
