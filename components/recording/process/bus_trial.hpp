// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/config.hpp"

#include <string>

namespace trigpoint::recording {

/// Joins the bus and leaves it; says which: "DDS domain 3 with fastdds". Throws ConfigError or
/// std::runtime_error, as every process would.
std::string try_to_join(const bus::Config& config);

}  // namespace trigpoint::recording
