// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "system_config.hpp"

namespace trigpoint::cli {

/// `trigpoint doctor --gps-filter`: drives the filter that runs on the bus through a simulated
/// drive and prints a table of checks. 0 when all hold.
int check_gps_filter(const SystemConfig& config, double rate);

}  // namespace trigpoint::cli
