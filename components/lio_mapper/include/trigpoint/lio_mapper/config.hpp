// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string>

namespace trigpoint {
class ConfigFields;
}

namespace trigpoint::lio_mapper {

/// The only defaults of lio_mapper; every field is described (unit, rule) in src/config.cpp.
struct Config {
  // Filled in by the implementer of the core.
};

void describe(Config& config, ConfigFields& fields);

}  // namespace trigpoint::lio_mapper
