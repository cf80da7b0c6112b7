// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// The driver repeats its last sample under new stamps.
class ImuStuck final : public Fault {
 public:
  void describe(ConfigFields&) override;
  void on_imu(ImuEpoch& epoch, const FaultMoment& moment) const override;
};

}  // namespace trigpoint::simulator
