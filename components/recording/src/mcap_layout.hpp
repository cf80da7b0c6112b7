// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where what is in an MCAP file, from its records' heads and its summary: nothing is decompressed.
#pragma once

#include "input_file.hpp"
#include "mcap_format.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::recording::mcap {

/// A stretch of the file that holds messages: a Chunk record, or Message records outside of chunks
/// that lie one behind the other.
struct Block {
  std::uint64_t begin{0};   ///< of its first record, byte of the file
  std::uint64_t length{0};  ///< with the records' heads
  bool chunk{false};
  Nanoseconds first_ns{0};  ///< as the chunk says
  Nanoseconds last_ns{0};
};

struct Layout {
  Header header;
  std::map<std::uint16_t, Schema> schemas;    ///< outside of chunks; their texts are left out
  std::map<std::uint16_t, Channel> channels;  ///< outside of chunks
  std::vector<Block> blocks;                  ///< as they lie in the file
  std::optional<Statistics> statistics;       ///< of a summary that is whole
  std::uint64_t data_end{0};                  ///< where the DataEnd record begins
  std::uint32_t data_crc{0};                  ///< of all bytes before it; 0: none
  /// What is wrong but hides no message, in sentences that begin with the file's name.
  std::vector<std::string> faults;
  /// Where messages are out of reach: cut off or overwritten.
  std::vector<std::string> damages;
};

/// Goes through the data section from record to record. Where it finds none, it goes on at the next
/// chunk that the summary knows, or ends there. Throws LogError when the file is no MCAP file of
/// version 0, or is cut off in its header.
Layout scan(InputFile& file);

/// Notes a Schema (without its text) or a Channel; passes over every other record. False when it is
/// damaged.
bool take_definition(Op op, Bytes record, Layout& layout);

}  // namespace trigpoint::recording::mcap
