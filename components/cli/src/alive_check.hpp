// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "system_config.hpp"

#include <string>

namespace trigpoint::cli {

/// Whether a program that runs here (as /proc has it: in this container) takes part in the bus: its
/// word, which all of ours give once a second whatever their sensors do, must be heard within
/// `patience_s`. As writers send to readers that they have found, hearing it shows that the program
/// neither hangs nor is deaf. 0 when it is so; else 1, with the reason on standard error.
int check_alive(const SystemConfig& config, const std::string& program, double patience_s);

}  // namespace trigpoint::cli
