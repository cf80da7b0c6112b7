// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bus_trial.hpp"

#include "trigpoint/bus/backend.hpp"
#include "trigpoint/bus/bus.hpp"

namespace trigpoint::recording {

std::string try_to_join(const bus::Config& config) {
  const bus::Participant participant(config, "trial");
  return "DDS domain " + std::to_string(bus::domain_of(config)) + " with " + bus::backend::name();
}

}  // namespace trigpoint::recording
