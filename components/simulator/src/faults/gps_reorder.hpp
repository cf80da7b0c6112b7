// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Fixes that arrive after newer ones.
class GpsReorder final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double share_{0.005};
  std::int64_t behind_{1};
};

}  // namespace trigpoint::simulator
