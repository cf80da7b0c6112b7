// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Messages whose numbers mean nothing, as drivers do send them.
class GpsGarbage final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  std::string kind_{"nan"};
  double share_{1.0};
};

}  // namespace trigpoint::simulator
