// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Stamps that are not quite right, and a latency that varies.
class GpsJitter final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

  double brings_forward_s() const override { return latency_s_; }

 private:
  double stamp_s_{0.02};
  double latency_s_{0.02};
};

}  // namespace trigpoint::simulator
