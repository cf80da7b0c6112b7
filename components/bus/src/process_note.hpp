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

/// "enclave=/;process=123;in=effc;" with our own number, and which numbering it is of: containers
/// have their own, where the same numbers come again.
std::string process_note();

/// Of a process in another numbering than ours: its number says nothing here.
inline constexpr unsigned kNumberedElsewhere = 0;

inline std::optional<unsigned> number_that_counts_here(unsigned noted) {
  return noted == kNumberedElsewhere ? std::nullopt : std::optional(noted);
}

/// The number in another's USER_DATA, or kNumberedElsewhere.
std::optional<unsigned> noted_process(std::span<const std::uint8_t> user_data);

/// Fast DDS writes the low 16 bits of the number into the GUIDs of its writers. `guid` is in
/// hexadecimal digits.
std::optional<unsigned> process_in_fastdds_guid(const std::string& guid);

}  // namespace trigpoint::bus
