// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string>

namespace trigpoint {
class ConfigFields;
}

namespace trigpoint::fusion_gate {

/// The only defaults of fusion_gate; every field is described (unit, rule) in src/config.cpp.
struct Config {
  // Filled in by the implementer of the core.
};

void describe(Config& config, ConfigFields& fields);

}  // namespace trigpoint::fusion_gate
