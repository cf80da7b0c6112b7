// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// The receiver falls back to another solution, and says so.
class GpsClass final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  std::string class_{"float"};
};

}  // namespace trigpoint::simulator
