// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Fixes that come more than once, bit by bit the same.
class GpsDuplicate final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double share_{0.01};
  std::int64_t copies_{1};
  double apart_s_{0.01};
};

}  // namespace trigpoint::simulator
