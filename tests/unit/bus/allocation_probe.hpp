// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Linked into a test, it sees every allocation of the program.
#pragma once

#include <cstddef>

namespace trigpoint::bus {

void reset_largest_allocation();
/// Bytes of the largest single allocation since the reset.
std::size_t largest_allocation();

}  // namespace trigpoint::bus
