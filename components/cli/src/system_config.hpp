// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/config.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/recording/log.hpp"

#include <string>
#include <vector>

namespace trigpoint::cli {

/// The one configuration document: what `trigpoint config` prints and every program reads its part
/// of.
struct SystemConfig {
  pipeline::CoreConfigs cores;
  bus::Config bus;
  recording::LogOptions log;
};

/// The gate's mode that a configuration names.
std::string mode_of(const SystemConfig& config);

void describe(SystemConfig& config, ConfigFields& fields);

/// Throws ConfigError with file, line, key and rule.
void load(SystemConfig& config, const std::vector<std::string>& files);

std::string print(SystemConfig config);

}  // namespace trigpoint::cli
