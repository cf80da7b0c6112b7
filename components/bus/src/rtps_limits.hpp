// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a datagram of RTPS may announce, for a middleware that believes it.
#pragma once

#include <cstdint>
#include <span>

namespace trigpoint::bus {

/// Of both vendors, sent and received; a dense map of 10 million points has 160 MB.
inline constexpr std::int64_t kLargestMessage_bytes = 256'000'000;

/// Whether a fragment in the datagram is said to belong to a sample that is larger than that. What
/// is not RTPS announces nothing: to refuse it is the middleware's part.
bool announces_more_than(std::span<const std::uint8_t> datagram, std::int64_t most_bytes);

}  // namespace trigpoint::bus
