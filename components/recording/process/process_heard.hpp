// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/config.hpp"

#include <set>

namespace trigpoint::recording {

/// Joins the bus until one of the processes is heard; false when none is within `patience_s`. All
/// programs of ours give their word once a second, whatever their sensors do. As writers send to
/// readers that they have found, it shows that the process neither hangs nor is deaf. Throws
/// std::runtime_error when the bus cannot be joined.
bool is_heard(const bus::Config& config, const std::set<unsigned>& processes, double patience_s);

}  // namespace trigpoint::recording
