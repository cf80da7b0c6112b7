// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How large a message from the network may be, and how much may be on its way at once.
#pragma once

#include "trigpoint/bus/qos.hpp"

#include <cstdint>

namespace trigpoint::bus {

/// Of both vendors, sent and received; a dense map of 10 million points has 160 MB.
inline constexpr std::int64_t kLargestMessage_bytes = 256'000'000;

/// Of topics that are not bulk. The largest of them are the diagnostics of a whole robot, some
/// 100 kB, and `tf_static`, with 100 bytes for each of its transforms.
inline constexpr std::int64_t kLargestSmallMessage_bytes = 1'000'000;

constexpr std::int64_t largest_message_bytes(const Qos& qos) {
  return qos.bulk ? kLargestMessage_bytes : kLargestSmallMessage_bytes;
}

/// What all samples together may take of which some fragments are there and others not: room for
/// the 40 clouds of 3 MB that a writer keeps for repairs, of four writers.
inline constexpr std::int64_t kIncompleteBulk_bytes = 512'000'000;
inline constexpr std::int64_t kIncompleteOther_bytes = 64'000'000;

}  // namespace trigpoint::bus
