// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How a participant tells others which process it is: in its USER_DATA, as ROS 2 writes its
// enclave.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace trigpoint::bus {

/// "enclave=/;process=123;" with our own number.
std::string process_note();

/// The number in another's USER_DATA.
std::optional<unsigned> noted_process(std::span<const std::uint8_t> user_data);

/// Fast DDS writes the low 16 bits of the number into the GUIDs of its writers. `guid` is in
/// hexadecimal digits.
std::optional<unsigned> process_in_fastdds_guid(const std::string& guid);

}  // namespace trigpoint::bus
