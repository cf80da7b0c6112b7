// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "bag_file.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>

namespace trigpoint::recording {

/// Decompressed chunks that may wait in memory for messages of others, bytes.
inline constexpr std::uint64_t kHeldChunks_bytes = 512U << 20U;

/// Known by its first bytes, whatever it is called, or by its name when it is cut off in there.
bool is_mcap(const std::filesystem::path& file);

/// An MCAP file, chunk by chunk. Throws LogError when it is none.
std::unique_ptr<BagFile> open_mcap_file(const std::filesystem::path& file,
                                        std::uint64_t held_bytes = kHeldChunks_bytes);

}  // namespace trigpoint::recording
