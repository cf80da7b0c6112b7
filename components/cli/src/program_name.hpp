// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <optional>
#include <string>

namespace trigpoint::cli {

/// The name of the program that process `number` runs; empty when there is none to be read.
std::string program_of(unsigned number);

/// "trigpoint_lio_mapper (process 123)", or "participant GUID" of what is none of ours. A number
/// tells a process on this computer only, and another's may have the same: so only a program of
/// ours is named.
std::string owner_text(std::optional<unsigned> process, const std::string& guid);

}  // namespace trigpoint::cli
