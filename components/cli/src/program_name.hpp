// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::cli {

/// The name of the program that process `number` runs; empty when there is none to be read.
std::string program_of(unsigned number);

}  // namespace trigpoint::cli
