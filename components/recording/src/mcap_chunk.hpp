// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What is inside a chunk of an MCAP file.
#pragma once

#include "mcap_format.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::recording::mcap {

/// Beyond this a chunk is taken for damaged.
inline constexpr std::uint64_t kLargestChunk_bytes = 1U << 30U;

/// A chunk's records, or why they can't be had.
struct Unpacked {
  std::vector<std::uint8_t> records;
  std::string problem;  ///< empty when all is well
};

/// Decompresses and checks the CRC. `record` is the whole Chunk record without its head. What the
/// chunk claims of its size is held against what its compression can reach before anything is
/// allocated.
Unpacked unpack_chunk(Bytes record);

/// The bytes as one zstd frame. Throws std::runtime_error when memory ends.
std::vector<std::uint8_t> compressed(Bytes records);

}  // namespace trigpoint::recording::mcap
