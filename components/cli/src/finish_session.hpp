// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "system_config.hpp"

#include <string>

namespace trigpoint::cli {

/// Renders map.pcd from the keyframes and writes report.md with its pictures; prints the table.
/// Returns an exit code.
int finish_session(const std::string& session);

/// The gate's mode that a configuration names.
std::string mode_of(const SystemConfig& config);

}  // namespace trigpoint::cli
