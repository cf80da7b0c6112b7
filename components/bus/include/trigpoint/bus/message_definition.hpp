// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The schema of a message as Foxglove, Lichtblick and MCAP files have it, from the IDL that the bus
// is compiled from. Needs no DDS and no generated type (library trigpoint::message_definition).
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace trigpoint::bus {

struct Field {
  std::string type;  ///< "float64", "string", "std_msgs/Header"
  std::string name;
  std::string array;  ///< "", "[]" or "[36]"
};

/// Structs by "package/Name", fields in order.
using Structs = std::map<std::string, std::vector<Field>, std::less<>>;

/// The part of IDL that idl/ uses: `module p { module msg { struct ... }; };`, annotations,
/// comments, fixed arrays and sequences. Throws std::runtime_error for anything else.
Structs parse_idl(std::string_view text);

/// Encoding "ros2msg": the fields of `ros_type` ("nav_msgs/msg/Odometry"), then each type that it
/// is made of under a line of 80 '=' and "MSG: package/Name". Throws std::runtime_error for a type
/// that is not there.
std::string message_definition(const Structs& structs, const std::string& ros_type);

/// The same from what is in idl/.
std::string message_definition(const std::string& ros_type);

}  // namespace trigpoint::bus
