// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What ROS 2 since Iron writes into the USER_DATA of writers and readers: a hash of what their type
// consists of (REP 2011, REP 2016). Nobody needs it to match; `ros2 topic info -v` shows it, and
// rmw_cyclonedds_cpp warns of each endpoint that has none.
#pragma once

#include <string>

namespace trigpoint::bus {

/// "typehash=RIHS01_...;" of a type of ours, by its name on the wire; empty for other types.
std::string type_hash_note(const std::string& dds_type);

}  // namespace trigpoint::bus
