// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_noise_scale.hpp"

namespace trigpoint::simulator {

void GpsNoiseScale::describe(ConfigFields& fields) {
  fields.number("factor", factor_, "on the error; what is reported stays", kNotNegative);
}

void GpsNoiseScale::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  epoch.error_scale *= factor_;
}

}  // namespace trigpoint::simulator
