// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_class.hpp"

#include "gnss_model.hpp"

namespace trigpoint::simulator {

void GpsClass::describe(ConfigFields& fields) {
  fields.choice("gnss_class", class_, "solution of the receiver meanwhile", gnss_class_names());
}

void GpsClass::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  epoch.gnss_class = class_;
}

}  // namespace trigpoint::simulator
